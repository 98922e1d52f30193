#include "server/report/comparison_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "server/base/units.h"
#include "server/report/budget_page.h"
#include "server/report/html.h"
#include "server/report/plain_page.h"

namespace trammel {

namespace {

constexpr double kWorthALine = 1e-3;  // of the difference

/// A paragraph for each line of a text.
std::string paragraphs(const std::string& text) {
  std::string html;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) html += "<p>" + html_text(line) + "</p>";
  return html;
}

std::string lines_table(const BudgetView& view) {
  double longest = 0;
  for (const BudgetLine& line : view.lines) longest = std::max(longest, line.alone_rms);
  std::vector<HtmlRow> rows;
  for (const BudgetLine& line : view.lines) {
    const bool within = !line.value || std::abs(line.value->value) <= line.value->u95;
    if (std::abs(line.share) < kWorthALine && within) continue;
    rows.push_back({{html_text(line.name), value_html(line),
                     bar_of(longest > 0 ? line.alone_rms / longest : 0, "budget_bar") +
                         fmt::format("{:.4f}", to_mm(line.alone_rms)),
                     fmt::format("{:.1f} %", 100 * line.share)}});
  }
  if (rows.empty()) return "<p>Nothing changed by more than its uncertainty.</p>";
  return html_table(
      {"budget stacks", {"line", "change ± U (k = 2)", "alone, mm rms", "share"}, rows});
}

std::string parameters_table(const ModelDifference& difference) {
  std::vector<HtmlRow> rows;
  for (const ParameterDifference& one : difference.parameters) {
    if (std::abs(one.difference()) <= one.u95) continue;
    rows.push_back(
        {{html_text(one.name), fmt::format("{:.6g}", one.before), fmt::format("{:.6g}", one.now),
          fmt::format("{:+.4g} ± {:.2g}", one.difference(), one.u95), html_text(one.unit)}});
  }
  if (rows.empty()) return "<p>No parameter differs by more than its uncertainty.</p>";
  return html_table(
      {"parameters flows", {"parameter", "A", "B", "B - A ± U (k = 2)", "unit"}, rows});
}

}  // namespace

std::string comparison_page(const Comparison& asked) {
  const ModelDifference& found = asked.difference;
  return plain_page(
      {.mark = {"comparison", asked.now.cell().name, asked.now.provenance().id},
       .title = fmt::format("Cell {}: what changed between two models", asked.now.cell().name),
       .subtitle = fmt::format("A: model {} · B: model {} · {}", asked.before.provenance().id,
                               asked.now.provenance().id, asked.where),
       .body = html_section("In words", paragraphs(asked.text)) +
               html_section("Beyond what touching base and tool frames would take away",
                            lines_table(found.budget.beyond_frames)) +
               html_section("As it stands", lines_table(found.budget.as_it_stands)) +
               html_section("Parameters that differ by more than their uncertainty",
                            parameters_table(found))});
}

}  // namespace trammel
