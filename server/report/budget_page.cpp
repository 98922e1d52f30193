#include "server/report/budget_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/report/html.h"

namespace trammel {

namespace {

constexpr double kWorthARow = 1e-3;  // of the error: shorter bars are not seen

/// A bar as long as its part of the longest one, and its length in words.
std::string bar(double length, double longest) {
  return bar_of(longest > 0 ? length / longest : 0, "budget_bar") +
         fmt::format("{:.4f}", to_mm(length));
}

std::string named(const BudgetLine& line) {
  std::string text = html_text(line.name);
  if (!line.with.empty() && line.kind != LineKind::kUntold)
    text += "<span class=\"note\"> and, not told from it by these poses, " +
            html_text(fmt::format("{}", fmt::join(line.with, ", "))) + "</span>";
  return text;
}

/// Shares of the same lines beyond frames.
std::map<std::string, double> shares_of(const BudgetView& view) {
  std::map<std::string, double> shares;
  for (const BudgetLine& line : view.lines) shares[line.line] = line.share;
  return shares;
}

HtmlRow row_of(const BudgetLine& line, double longest,
               const std::map<std::string, double>& beyond_frames) {
  const auto beyond = beyond_frames.find(line.line);
  return {
      {named(line), value_html(line), bar(line.alone_rms, longest),
       fmt::format("{:.1f} %", 100 * line.share),
       beyond == beyond_frames.end() ? "" : fmt::format("{:.1f} %", 100 * beyond->second),
       fmt::format("{:.4f}", to_mm(line.left_if_right)),
       line.times_usual ? fmt::format("{:.1f}", *line.times_usual) : "", html_text(line.action)},
      line.action.empty() ? "" : "stands_out"};
}

}  // namespace

std::string value_html(const BudgetLine& line) {
  if (!line.value) return "";
  const ShownValue read = show_read(line.value->value, line.value->u95, {1, line.value->unit});
  return fmt::format("{} ± {} {}", read.value, read.expanded, html_text(line.value->unit));
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
  double longest = 0;
  for (const BudgetLine& line : view.lines) longest = std::max(longest, line.alone_rms);
  const std::map<std::string, double> beyond = shares_of(budget->beyond_frames);
  std::vector<HtmlRow> rows;
  std::size_t small = 0;
  std::string untold;
  for (const BudgetLine& line : view.lines) {
    if (line.kind == LineKind::kUntold) untold = fmt::format("{}", fmt::join(line.with, ", "));
    const auto share = beyond.find(line.line);
    const bool worth = std::abs(line.share) > kWorthARow || !line.action.empty() ||
                       (share != beyond.end() && std::abs(share->second) > kWorthARow);
    if (worth) rows.push_back(row_of(line, longest, beyond));
    small += worth || line.kind == LineKind::kUntold ? 0 : 1;
  }
  std::string text;
  if (const std::string doubt = doubt_of_file(*budget); !doubt.empty())
    text += "<p class=\"verdict\">" + html_text(doubt) + "</p>";
  for (const BudgetLine& line : budget->between_sessions)
    text += "<p>" +
            html_text(fmt::format("Since session {}, at its poses: {}", line.since_session,
                                  sentence(line))) +
            "</p>";
  text += fmt::format(
      "<p class=\"note\">The drawing is off by {:.4f} mm rms at {} poses. Touching base and tool "
      "frames would leave {:.4f} mm. Alone: what a line does to the poses. Shares add to 100 %. "
      "Left: what would be left if only this line were put right.{}</p>",
      to_mm(view.error_rms), budget->poses, to_mm(budget->beyond_frames.error_rms),
      small > 0 ? fmt::format(" {} more lines have less than 0.1 %.", small) : "");
  text += html_table({"budget stacks",
                      {"line", "value ± U (k = 2)", "alone, mm rms", "share", "share beyond frames",
                       "left, mm rms", "times usual", "what to do"},
                      rows});
  if (!untold.empty())
    text += "<p class=\"note\">What these poses cannot tell: " + html_text(untold) + ".</p>";
  return html_section("Where the millimetres come from", text);
}

}  // namespace trammel
