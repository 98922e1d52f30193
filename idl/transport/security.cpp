#include "idl/transport/security.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/objects.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <ctime>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "server/base/text_file.h"

namespace trammel::wire {
namespace {

template <auto kFree>
struct Free {
  template <typename T>
  void operator()(T* thing) const {
    kFree(thing);
  }
};
using Bio = std::unique_ptr<BIO, Free<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using RevocationList = std::unique_ptr<X509_CRL, Free<X509_CRL_free>>;
using Name = std::unique_ptr<X509_NAME, Free<X509_NAME_free>>;
using Key = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;
using Signed = std::unique_ptr<PKCS7, Free<PKCS7_free>>;
using Authorities = std::unique_ptr<X509_STORE, Free<X509_STORE_free>>;
using Verification = std::unique_ptr<X509_STORE_CTX, Free<X509_STORE_CTX_free>>;

Bio bio_of(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::string text_of(BIO* bio) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  return {data, static_cast<std::size_t>(size)};
}

/// One participant's folder.
class Folder {
 public:
  explicit Folder(std::string path) : path_(std::move(path)) {}

  [[nodiscard]] std::string path(const char* name) const { return path_ + "/" + name; }
  [[nodiscard]] Result<std::string> text(const char* name) const {
    return read_text_file(path(name));
  }
  [[nodiscard]] Failure wrong(const char* name, const std::string& why) const {
    return refused("{}", why).in(path(name));
  }
  [[nodiscard]] Result<Certificate> certificate(const char* name) const {
    const auto pem = TRY(text(name));
    Certificate certificate(PEM_read_bio_X509(bio_of(pem).get(), nullptr, nullptr, nullptr));
    if (!certificate) return wrong(name, "no certificate in PEM form");
    return certificate;
  }

 private:
  std::string path_;
};

std::string text_of(const X509_NAME& name) {
  const Bio out(BIO_new(BIO_s_mem()));
  X509_NAME_print_ex(out.get(), &name, 0, XN_FLAG_RFC2253);
  return text_of(out.get());
}

std::string subject_of(const X509& certificate) {
  return text_of(*X509_get_subject_name(&certificate));
}

/// The authority of identities with the revocation lists behind it.
Result<Authorities> identity_authority(const Folder& folder) {
  constexpr const char* kName = "identity_ca.cert.pem";
  const auto pem = TRY(folder.text(kName));
  const Bio bio = bio_of(pem);
  const Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  if (!certificate) return folder.wrong(kName, "no certificate in PEM form");
  Authorities authorities(X509_STORE_new());
  X509_STORE_add_cert(authorities.get(), certificate.get());
  while (const RevocationList list{PEM_read_bio_X509_CRL(bio.get(), nullptr, nullptr, nullptr)}) {
    X509_STORE_add_crl(authorities.get(), list.get());
    X509_STORE_set_flags(authorities.get(), X509_V_FLAG_CRL_CHECK);
  }
  return authorities;
}

Status check_certificate(const Folder& folder, X509& certificate) {
  const auto authorities = TRY(identity_authority(folder));
  const Verification verification(X509_STORE_CTX_new());
  X509_STORE_CTX_init(verification.get(), authorities.get(), &certificate, nullptr);
  if (X509_verify_cert(verification.get()) == 1) return {};
  return folder
      .wrong("cert.pem",
             X509_verify_cert_error_string(X509_STORE_CTX_get_error(verification.get())))
      .next("ask whoever issues certificates for a new one; see deploy/security/README.md");
}

Status check_key(const Folder& folder, const X509& certificate) {
  struct stat file {};
  if (::stat(folder.path("key.pem").c_str(), &file) == 0 &&
      (file.st_mode & (S_IRWXG | S_IRWXO) & ~S_IRGRP) != 0) {
    return folder.wrong("key.pem", "others than its owner and group may read or change it")
        .next("chmod 640 " + folder.path("key.pem"));
  }
  const auto pem = TRY(folder.text("key.pem"));
  const Key key(PEM_read_bio_PrivateKey(bio_of(pem).get(), nullptr, nullptr, nullptr));
  if (!key) return folder.wrong("key.pem", "no private key in PEM form, or one with a password");
  if (X509_check_private_key(&certificate, key.get()) != 1)
    return folder.wrong("key.pem", "not the key of cert.pem");
  return {};
}

/// The text that the authority of the permissions signed.
Result<std::string> signed_text(const Folder& folder, const char* name, X509& authority) {
  const auto smime = TRY(folder.text(name));
  BIO* content = nullptr;
  const Signed parsed(SMIME_read_PKCS7(bio_of(smime).get(), &content));
  const Bio given(content);
  if (!parsed || !given) return folder.wrong(name, "no signed rules in S/MIME form");
  Authorities authorities(X509_STORE_new());
  X509_STORE_add_cert(authorities.get(), &authority);
  const Bio out(BIO_new(BIO_s_mem()));
  if (PKCS7_verify(parsed.get(), nullptr, authorities.get(), given.get(), out.get(), PKCS7_TEXT) !=
      1)
    return folder.wrong(name,
                        "changed since it was signed, or not signed by permissions_ca.cert.pem");
  return text_of(out.get());
}

/// The text between <tag> and </tag>, of the first one; empty: there is none.
std::string element(const std::string& xml, const std::string& tag) {
  const std::size_t open = xml.find("<" + tag + ">");
  if (open == std::string::npos) return {};
  const std::size_t begin = open + tag.size() + 2;
  const std::size_t end = xml.find("</" + tag + ">", begin);
  return end == std::string::npos ? std::string() : xml.substr(begin, end - begin);
}

/// `2026-11-22T10:00:00` (UTC, a Z or nothing behind it) as Unix time.
std::optional<std::time_t> unix_time(const std::string& text) {
  std::tm parts{};
  if (::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &parts) == nullptr) return std::nullopt;
  return ::timegm(&parts);
}

Status check_permissions(const Folder& folder, const std::string& subject, const std::string& xml) {
  constexpr const char* kName = "permissions.p7s";
  if (const std::string theirs = element(xml, "subject_name"); theirs != subject)
    return folder.wrong(kName, fmt::format("for {}, and cert.pem is of {}", theirs, subject));
  const auto from = unix_time(element(xml, "not_before")),
             to = unix_time(element(xml, "not_after"));
  const std::time_t now = std::time(nullptr);
  if (from && now < *from)
    return folder.wrong(kName, "not valid before " + element(xml, "not_before"));
  if (to && now > *to) return folder.wrong(kName, "expired on " + element(xml, "not_after"));
  return {};
}

/// The role in `<grant name="line-3: server">`, as deploy/security/keys writes it.
std::string role_in(const std::string& permissions) {
  constexpr std::string_view kBegin = "<grant name=\"";
  const std::size_t begin = permissions.find(kBegin);
  if (begin == std::string::npos) return {};
  const std::size_t end = permissions.find('"', begin + kBegin.size());
  const std::size_t colon = permissions.find(": ", begin);
  if (end == std::string::npos || colon >= end) return {};
  const std::string role = permissions.substr(colon + 2, end - colon - 2);
  constexpr std::array<std::string_view, 5> kKnown{"server", "observer", "cam", "metrologist",
                                                   "engineer"};
  return std::find(kKnown.begin(), kKnown.end(), role) == kKnown.end() ? std::string() : role;
}

struct NamePart {
  std::string key, value;
};

/// The parts of `/O=Works/CN=cam-7`. A `/` that begins no part belongs to the value before it.
std::vector<NamePart> name_parts(const std::string& line) {
  std::vector<NamePart> parts;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t end = std::min(line.find('/', at + 1), line.size()),
                      equals = line.find('=', at);
    const std::string key = equals < end ? line.substr(at + 1, equals - at - 1) : std::string();
    if (line[at] == '/' && OBJ_txt2nid(key.c_str()) != NID_undef) {
      parts.push_back({key, line.substr(equals + 1, end - equals - 1)});
    } else if (!parts.empty()) {
      parts.back().value += line.substr(at, end - at);
    }
    at = end;
  }
  return parts;
}

/// Octets beyond ASCII are written `\xC3`.
std::string unescaped(const std::string& text) {
  std::string octets;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned octet = 0;
    const char* hex = text.data() + i + 2;
    const bool is_escaped = text.compare(i, 2, "\\x") == 0 && i + 4 <= text.size() &&
                            std::from_chars(hex, hex + 2, octet, 16).ptr == hex + 2;
    octets += is_escaped ? static_cast<char>(octet) : text[i];
    if (is_escaped) i += 3;
  }
  return octets;
}

/// As authorities write a name: `type` is how OpenSSL encodes its texts. Null: it cannot be.
Name name_of(const std::vector<NamePart>& parts, int type) {
  Name name(X509_NAME_new());
  for (const NamePart& part : parts) {
    const std::string value = unescaped(part.value);
    const auto* octets = reinterpret_cast<const unsigned char*>(value.data());
    const int size = static_cast<int>(value.size());
    if (X509_NAME_add_entry_by_txt(name.get(), part.key.c_str(), type, octets, size, -1, 0) != 1)
      return nullptr;
  }
  return name;
}

/// As DDS-Security has GUIDs begin: a bit that is set, and 47 bits of the hash of the subject.
bool begins_with_hash(const std::string& participant, const X509_NAME& name) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned length = 0;
  if (participant.size() < 6 || X509_NAME_digest(&name, EVP_sha256(), hash.data(), &length) != 1)
    return false;
  unsigned carried = 1;
  for (std::size_t i = 0; i < 6; ++i) {
    const unsigned expected = (carried << 7 | unsigned{hash[i]} >> 1) & 0xFF;
    if (static_cast<unsigned char>(participant[i]) != expected) return false;
    carried = hash[i];
  }
  return true;
}

}  // namespace

std::string confirmed_subject(const std::string& claimed, const std::string& participant) {
  constexpr std::size_t kLongest = 512;
  if (claimed.size() > kLongest) return {};
  const std::vector<NamePart> parts = name_parts(claimed);
  for (const int type : {MBSTRING_UTF8, V_ASN1_PRINTABLESTRING, V_ASN1_UTF8STRING}) {
    const Name name = name_of(parts, type);
    if (name && begins_with_hash(participant, *name)) return text_of(*name);
  }
  ERR_clear_error();
  return {};
}

Result<Security> read_security(const std::string& path) {
  const Folder folder(path);
  const auto certificate = TRY(folder.certificate("cert.pem"));
  TRY(check_certificate(folder, *certificate));
  TRY(check_key(folder, *certificate));
  const auto authority = TRY(folder.certificate("permissions_ca.cert.pem"));
  const auto governance = TRY(signed_text(folder, "governance.p7s", *authority));
  const auto permissions = TRY(signed_text(folder, "permissions.p7s", *authority));
  const std::string subject = subject_of(*certificate);
  TRY(check_permissions(folder, subject, permissions));
  const std::string kind = element(governance, "rtps_protection_kind");
  return Security{path, subject, role_in(permissions), !kind.empty() && kind != "NONE"};
}

Status check_serves(const Security& security) {
  if (security.role.empty() || security.role == "server") return {};
  return Folder(security.folder)
      .wrong("permissions.p7s",
             fmt::format("{} has the role {}, and a service needs the role server",
                         security.subject, security.role))
      .next("keys issue PLANT server NAME makes such a folder; see deploy/security/README.md");
}

}  // namespace trammel::wire
