#include "server/report/budget_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/report/html.h"

namespace trammel {

namespace {

constexpr double kWorthARow = 1e-3;  // of the error: shorter bars are not seen

std::string named(const BudgetLine& line) {
  std::string text = html_text(line.name);
  if (!line.with.empty() && line.kind != LineKind::kUntold)
    text += "<span class=\"note\"> and, not told from it by these poses, " +
            html_text(partners_in_words(line)) + "</span>";
  if (!line.action.empty()) text += "<span class=\"action\">" + html_text(line.action) + "</span>";
  return text;
}

/// `47.9 %`; a share that rounds to nothing has no sign.
std::string in_percent(double share) {
  const double tenths = std::round(1e3 * share);
  return fmt::format("{:.1f} %", tenths == 0 ? 0.0 : tenths / 10);
}

double share_of(const BudgetLine& line) { return std::isfinite(line.share) ? line.share : 0; }

/// The steps from the drawing (nothing explained) to the whole error, each starting at the end of
/// the previous one.
class Waterfall {
 public:
  explicit Waterfall(const std::vector<BudgetLine>& lines) {
    double sum = 0;
    for (const BudgetLine& line : lines) {
      sum += share_of(line);
      low_ = std::min(low_, sum);
      high_ = std::max(high_, sum);
    }
  }
  std::string step(double share) {
    const double from = at(sum_), to = at(sum_ += share);
    return fmt::format(
        R"(<svg class="fall" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">)"
        R"(<path d="M0 9.5H100"/><rect x="{:.2f}" width="{:.2f}" height="9"/></svg>)",
        std::min(from, to), std::max(std::abs(to - from), kLeastBar));
  }

 private:
  static constexpr double kLeastBar = 0.6;  // of 100: still seen
  [[nodiscard]] double at(double sum) const {
    return (100 - kLeastBar) * (sum - low_) / (high_ - low_);
  }
  double low_ = 0, high_ = 1, sum_ = 0;
};

/// Shares of the same lines beyond frames.
std::map<std::string, double> shares_of(const BudgetView& view) {
  std::map<std::string, double> shares;
  for (const BudgetLine& line : view.lines) shares[line.line] = line.share;
  return shares;
}

HtmlRow row_of(const BudgetLine& line, Waterfall& waterfall,
               const std::map<std::string, double>& beyond_frames) {
  const auto beyond = beyond_frames.find(line.line);
  return {{named(line), value_html(line), waterfall.step(share_of(line)), in_percent(line.share),
           beyond == beyond_frames.end() ? "" : in_percent(beyond->second),
           fmt::format("{:.4f}", to_mm(line.alone_rms)),
           fmt::format("{:.4f}", to_mm(line.left_if_right)),
           line.times_usual ? fmt::format("{:.1f}", *line.times_usual) : ""},
          line.action.empty() ? "" : "stands_out"};
}

/// One row for all lines whose bars are too small to see, so that the bars add up to the whole.
HtmlRow row_of_small(int count, double share, Waterfall& waterfall) {
  return {{fmt::format("{} lines of less than {:g} % each", count, 100 * kWorthARow), "",
           waterfall.step(share), in_percent(share), "", "", "", ""}};
}

}  // namespace

std::string value_html(const BudgetLine& line) {
  std::string text = html_text(value_in_words(line));
  if (const std::size_t comma = text.find(", "); comma != std::string::npos)
    text.replace(comma, 2, ",<br>");
  return text;
}

std::string bar_of(double share, const char* kind) {
  return fmt::format(
      R"(<svg class="{}" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">)"
      R"(<rect width="{:.1f}" height="10"/></svg>)",
      kind, 100 * share);
}

std::string budget_section(const std::optional<ErrorBudget>& budget) {
  if (!budget || budget->as_it_stands.lines.empty())
    return html_section(
        "Where the millimetres come from",
        "<p class=\"note\">Not known: no pose has a measured position, or the model is older.</p>");
  const BudgetView& view = budget->as_it_stands;
  const std::map<std::string, double> beyond = shares_of(budget->beyond_frames);
  Waterfall waterfall(view.lines);
  std::vector<HtmlRow> rows;
  int small = 0;
  double small_share = 0;
  std::string untold;
  for (const BudgetLine& line : view.lines) {
    if (line.kind == LineKind::kUntold) untold = partners_in_words(line);
    const auto share = beyond.find(line.line);
    const bool worth = std::abs(line.share) > kWorthARow || !line.action.empty() ||
                       (share != beyond.end() && std::abs(share->second) > kWorthARow);
    if (worth) rows.push_back(row_of(line, waterfall, beyond));
    if (worth || line.kind == LineKind::kUntold) continue;
    ++small;
    small_share += share_of(line);
  }
  if (small > 0) rows.push_back(row_of_small(small, small_share, waterfall));
  std::string text;
  if (const std::string doubt = doubt_of_file(*budget); !doubt.empty())
    text += "<p class=\"verdict\">" + html_text(doubt) + "</p>";
  for (const BudgetLine& line : budget->between_sessions)
    text += "<p>" +
            html_text(fmt::format("At the poses since session {}: {}", line.since_session,
                                  sentence(line))) +
            "</p>";
  text += fmt::format(
      "<p class=\"note\">The drawing is off by {:.4f} mm rms at {} poses. Touching base and tool "
      "frames would leave {:.4f} mm. {}Steps lead from the drawing to the whole error: each begins "
      "where the one above it ends, and their shares add to 100 %. Alone: what a line does to the "
      "poses. Left: what would be left if only this line were put right.</p>",
      to_mm(view.error_rms), budget->poses, to_mm(budget->beyond_frames.error_rms),
      is_usual(view.lines)
          ? "No zero, length, angle or tool is far from what arms of its kind show. "
          : "");
  text += html_table({"budget stacks",
                      {"line", "value ± U (k = 2)", "steps", "share", "share beyond frames",
                       "alone, mm rms", "left, mm rms", "times usual"},
                      rows});
  if (!untold.empty())
    text += "<p class=\"note\">What these poses cannot tell: " + html_text(untold) + ".</p>";
  return html_section("Where the millimetres come from", text);
}

}  // namespace trammel
