#include "server/host/log_limit.h"

#include <utility>

namespace trammel {

LogLimit::Verdict LogLimit::look(std::string_view kind, Time now) {
  auto found = kinds_.find(kind);
  if (found == kinds_.end()) found = kinds_.emplace(kind, While{now}).first;
  While& since = found->second;
  if (now - since.began >= kWithin) {
    since.began = now;
    since.lines = 0;
  }
  if (since.lines >= kMost) {
    ++since.left_out;
    return {false, 0};
  }
  ++since.lines;
  return {true, std::exchange(since.left_out, 0)};
}

}  // namespace trammel
