#include "server/report/remedies_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/compensate/budget/remedies.h"
#include "server/report/budget_page.h"
#include "server/report/html.h"
#include "server/report/plain_page.h"

namespace trammel {

namespace {

std::string steps_table(const ErrorBudget& budget) {
  double longest = 0;
  for (const PutRight& step : budget.put_right) longest = std::max(longest, step.left_rms);
  std::vector<HtmlRow> rows;
  for (const PutRight& step : budget.put_right) {
    const double share = longest > 0 ? step.left_rms / longest : 0;
    rows.push_back({{html_text(step.name), bar_of(share, "step_bar"),
                     fmt::format("{:.4f}", to_mm(step.left_rms))}});
  }
  return html_table({"steps", {"put right, one after the other", "", "left, mm rms"}, rows});
}

std::string zeros_table(const ErrorBudget& budget, const Chain& robot) {
  const MakersWords words = makers_words(robot);
  const std::vector<ZeroRemedy> zeros = zero_remedies(budget);
  if (zeros.empty()) return "<p>No zero is off by more than its uncertainty.</p>";
  std::vector<HtmlRow> rows;
  for (const ZeroRemedy& zero : zeros) {
    const ShownValue read = show_read(zero.add, zero.u95, {1, zero.unit});
    rows.push_back({{fmt::format("joint {}", zero.joint + 1), html_text(words.axis(zero.joint)),
                     fmt::format("{}{} ± {} {}", zero.add > 0 ? "+" : "", read.value, read.expanded,
                                 zero.unit)}});
  }
  return fmt::format("<p>The joint stands at the angle shown plus this. {}: {}.</p>",
                     html_text(words.maker.empty() ? "In the controller" : words.maker),
                     html_text(words.zeros)) +
         html_table({"zeros", {"zero of", "on the pendant", "add to the angle shown"}, rows}) +
         fmt::format("<p>Lengths: {}. Load data: {}.</p>", html_text(words.lengths),
                     html_text(words.load));
}

}  // namespace

std::string remedies_page(const CompensatedModel& model, const ErrorBudget& budget,
                          const std::string& where) {
  const Chain& robot = model.cell().robot;
  return plain_page(
      {.mark = {"remedies", model.cell().name, model.provenance().id},
       .title = fmt::format("Cell {}: what could be put right where", model.cell().name),
       .subtitle = fmt::format("{} · model {} · {}", robot.name(), model.provenance().id, where),
       .body = html_section("What each step leaves", steps_table(budget)) +
               html_section("Zeros of the joints", zeros_table(budget, robot)) +
               budget_section(budget)});
}

}  // namespace trammel
