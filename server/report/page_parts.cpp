#include "server/report/page_parts.h"

#include <array>
#include <ctime>

#include "server/report/embedded.h"

namespace trammel {

std::string_view page_style() { return embedded::page_css; }
std::string_view view3d_script() { return embedded::view3d_js; }

std::string_view sort_tables_script() { return embedded::sort_tables_js; }

std::string shown_day(std::int64_t unix_s) {
  if (unix_s <= 0) return "–";
  const std::time_t time = unix_s;
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  std::array<char, 16> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d", &utc);
  return text.data();
}

std::string with_micro(std::string text) {
  for (std::size_t at = text.find(" um"); at != std::string::npos; at = text.find(" um", at + 1)) {
    const bool ends = at + 3 == text.size() ||
                      std::string_view(" ,.;:)").find(text[at + 3]) != std::string_view::npos;
    if (ends) text.replace(at + 1, 1, "µ");
  }
  return text;
}

}  // namespace trammel
