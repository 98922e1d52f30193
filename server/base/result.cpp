#include "server/base/result.h"

#include <iterator>

#include "server/base/check.h"
#include "server/base/plain_text.h"

namespace trammel {

const char* to_text(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return "usage";
    case ErrorCode::kRefused:
      return "refused";
    case ErrorCode::kNotFound:
      return "not_found";
    case ErrorCode::kConflict:
      return "conflict";
    case ErrorCode::kTooLarge:
      return "too_large";
    case ErrorCode::kBusy:
      return "busy";
    case ErrorCode::kUnreachable:
      return "unreachable";
    case ErrorCode::kInternal:
      return "internal";
  }
  return "internal";
}

std::string sentence(const Error& error) {
  std::string text = shown(error.file);
  if (error.row) text += fmt::format("{}row {}", text.empty() ? "" : " ", *error.row);
  if (!text.empty()) text += ": ";
  text += shown_lines(error.message);
  if (!error.next.empty()) text += "; " + shown_lines(error.next);
  for (const Error& other : error.also) text += "\n" + sentence(other);
  return text;
}

Error together(std::vector<Error> problems) {
  TRAMMEL_CHECK(!problems.empty());
  Error all = std::move(problems.front());
  all.also.insert(all.also.end(), std::make_move_iterator(problems.begin() + 1),
                  std::make_move_iterator(problems.end()));
  return all;
}

std::vector<Error> apart(const Error& error) {
  std::vector<Error> each = {error};
  each.front().also.clear();
  for (const Error& other : error.also) {
    for (Error& one : apart(other)) each.push_back(std::move(one));
  }
  return each;
}

}  // namespace trammel
