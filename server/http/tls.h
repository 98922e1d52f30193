#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// The certificate of a server and its key, for TLS 1.2 and newer.
using TlsContext = std::shared_ptr<SSL_CTX>;

/// Reads two PEM files. Refuses files that cannot be read or do not belong together, and a key that
/// others than its owner and group may read.
[[nodiscard]] Result<TlsContext> open_tls(const std::string& certificate, const std::string& key);

}  // namespace trammel
