#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// What a client may do, as on DDS (deploy/security/README.md). Each may what the one before it
/// may. The fifth role there, `server`, asks for nothing.
enum class Role { kObserver, kCam, kMetrologist, kEngineer };
[[nodiscard]] const char* to_text(Role role);

/// Who sent a request.
struct Asker {
  std::string name;  ///< stands in the log and in the audit trail
  Role role = Role::kObserver;
};

/// The bearer tokens of a server. The file has a line `NAME ROLE SHA-256` for each, the hash of the
/// token in hexadecimal: who reads the file has no token. `#` begins a comment.
class Tokens {
 public:
  /// Refuses, all lines at once: a file that others than its owner and group may read, a line of
  /// another form, a role that may not ask, a name or a hash that occurs twice.
  [[nodiscard]] static Result<Tokens> read(const std::string& path);

  /// Whose token the header `Authorization` shows: `Bearer TOKEN`, or `Basic` with the name and the
  /// token, which browsers ask people for. Empty: nobody's.
  [[nodiscard]] std::optional<Asker> asker_of(const std::string& authorization) const;

 private:
  std::map<std::string, Asker> by_hash_;
};

/// The bytes of Base64; empty where it is none.
[[nodiscard]] std::optional<std::string> from_base64(const std::string& text);
[[nodiscard]] std::string to_base64(const std::string& bytes);

}  // namespace trammel
