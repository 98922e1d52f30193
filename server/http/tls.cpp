#include "server/http/tls.h"

#include <openssl/err.h>
#include <sys/stat.h>

#include <array>

namespace trammel {
namespace {

Failure unusable(const std::string& path) {
  std::array<char, 256> why{};
  ::ERR_error_string_n(::ERR_get_error(), why.data(), why.size());
  return refused("cannot be used for TLS: {}", why.data()).in(path);
}

}  // namespace

Result<TlsContext> open_tls(const std::string& certificate, const std::string& key) {
  struct stat file {};
  if (::stat(key.c_str(), &file) == 0 && (file.st_mode & S_IRWXO) != 0)
    return refused("others than its owner and group may read it").in(key).next("chmod o= " + key);
  ::ERR_clear_error();
  TlsContext context(::SSL_CTX_new(::TLS_server_method()), ::SSL_CTX_free);
  if (!context) return unusable(certificate);
  ::SSL_CTX_set_min_proto_version(context.get(), TLS1_2_VERSION);
  ::SSL_CTX_set_mode(context.get(),
                     SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (::SSL_CTX_use_certificate_chain_file(context.get(), certificate.c_str()) != 1)
    return unusable(certificate);
  if (::SSL_CTX_use_PrivateKey_file(context.get(), key.c_str(), SSL_FILETYPE_PEM) != 1 ||
      ::SSL_CTX_check_private_key(context.get()) != 1)
    return unusable(key);
  return context;
}

}  // namespace trammel
