#include "server/base/result.h"

namespace trammel {

std::string sentence(const Error& error) {
  std::string text = error.file;
  if (error.row) text += fmt::format("{}row {}", text.empty() ? "" : " ", *error.row);
  if (!text.empty()) text += ": ";
  text += error.message;
  if (!error.next.empty()) text += "; " + error.next;
  return text;
}

}  // namespace trammel
