#include "server/calibrate/one_session.h"

#include <algorithm>

namespace trammel {

bool is_of_one_session(const Change& change) {
  const std::size_t at = std::min(change.source.find('@'), change.source.size());
  return std::count(change.source.begin() + static_cast<std::ptrdiff_t>(at), change.source.end(),
                    '+') > 1;
}

}  // namespace trammel
