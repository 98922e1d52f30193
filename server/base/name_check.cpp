#include "server/base/name_check.h"

#include "server/base/plain_text.h"

namespace trammel {

Status check_name(std::string_view name, const char* what, std::size_t limit_bytes) {
  if (name.size() > limit_bytes)
    return failure(ErrorCode::kTooLarge, "{} of {} bytes, limit {}", what, name.size(), limit_bytes)
        .of(what)
        .beyond(name.size(), limit_bytes);
  if (!is_utf8(name))
    return refused("{} '{}' is not UTF-8 text", what, shown(name)).of(what).with_text(shown(name));
  if (!is_plain(name))
    return refused("{} '{}' has control characters or others that nobody sees", what, shown(name))
        .of(what)
        .with_text(shown(name));
  return {};
}

}  // namespace trammel
