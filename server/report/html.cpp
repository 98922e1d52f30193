#include "server/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/base/check.h"

namespace trammel {

std::string html_text(std::string_view text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string html_row(const std::vector<std::string>& cells, const char* cell_tag) {
  std::string row = "<tr>";
  for (const std::string& cell : cells) row += fmt::format("<{0}>{1}</{0}>", cell_tag, cell);
  return row + "</tr>\n";
}

std::string fill_in(std::string_view page, const std::map<std::string, std::string, std::less<>>& contents) {
  std::string filled;
  while (true) {
    const std::size_t open = page.find("{{");
    filled += page.substr(0, open);
    if (open == std::string_view::npos) return filled;
    const std::size_t close = page.find("}}", open);
    TRAMMEL_CHECK(close != std::string_view::npos);
    const auto content = contents.find(page.substr(open + 2, close - open - 2));
    TRAMMEL_CHECK(content != contents.end());
    filled += content->second;
    page.remove_prefix(close + 2);
  }
}

ShownValue show_with_uncertainty(double value, double expanded) {
  if (!(expanded > 0) || !std::isfinite(expanded))
    return {fmt::format("{:.4g}", value), fmt::format("{:.2g}", expanded)};
  const auto order = [](double x) { return x == 0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(x)))); };
  const int decimals = 1 - order(expanded);
  if (decimals >= 0 && decimals <= 4)
    return {fmt::format("{:.{}f}", value, decimals), fmt::format("{:.{}f}", expanded, decimals)};
  constexpr int kLongest = 5;  // digits in front of the point that still read as a number
  if (decimals < 0 && order(expanded) < kLongest && order(value) < kLongest) {
    const double step = std::pow(10, -decimals);
    return {fmt::format("{:.0f}", std::round(value / step) * step),
            fmt::format("{:.0f}", std::round(expanded / step) * step)};
  }
  const int digits = value == 0 ? 1 : std::clamp(order(value) - order(expanded) + 1, 0, 9);
  return {fmt::format("{:.{}e}", value, digits), fmt::format("{:.1e}", expanded)};
}

}  // namespace trammel
