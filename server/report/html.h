#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace trammel {

/// Text as it stands, whatever it holds.
[[nodiscard]] std::string html_text(std::string_view text);
/// A row of a table; cells are HTML.
[[nodiscard]] std::string html_row(const std::vector<std::string>& cells, const char* cell_tag = "td");
/// `page` with every `{{name}}` replaced, once; a name without content is a bug.
[[nodiscard]] std::string fill_in(std::string_view page,
                                  const std::map<std::string, std::string, std::less<>>& contents);

/// A value and the half width of its interval, both rounded to what the width is worth: two digits of it.
struct ShownValue {
  std::string value, expanded;
};
[[nodiscard]] ShownValue show_with_uncertainty(double value, double expanded);

}  // namespace trammel
