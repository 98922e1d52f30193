#include "server/report/after_repair_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/report/budget_json.h"
#include "server/report/html.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

ordered_json number_json(const BudgetNumber& number) {
  return {{"value", number.value}, {"u95", number.u95}};
}

bool is_told(const LineOutcome& line) { return line.helped != LineOutcome::Helped::kCannotTell; }

ordered_json outcome_json(const LineOutcome& line) {
  return {{"line", line.line},
          {"name", line.name},
          {"unit", line.before.unit},
          {"before", number_json(line.before)},
          {"moved", is_told(line) ? number_json(line.moved) : ordered_json(nullptr)},
          {"now", is_told(line) ? number_json(line.now) : ordered_json(nullptr)},
          {"alone_before_mm", to_mm(line.alone_before)},
          {"helped", to_string(line.helped)},
          {"action", line.action}};
}

std::string outcome_in_words(const LineOutcome& line) {
  std::string words(to_string(line.helped));
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

}  // namespace

ordered_json after_repair_json(const AfterRepair& repair) {
  ordered_json json = {{"model", repair.model},
                       {"poses", repair.now.poses},
                       {"before_rms_mm", to_mm(repair.before.beyond_frames.error_rms)},
                       {"now_rms_mm", to_mm(repair.now.beyond_frames.error_rms)},
                       {"lines", ordered_json::array()},
                       {"moved", budget_view_json(repair.difference.budget.beyond_frames)},
                       {"sentences", in_words(repair)}};
  for (const LineOutcome& line : repair.lines) json["lines"].push_back(outcome_json(line));
  return json;
}

std::string after_repair_section(const AfterRepair& repair) {
  std::vector<HtmlRow> rows;
  for (const LineOutcome& line : repair.lines)
    rows.push_back(
        {{html_text(line.name), html_text(in_words(line.before)),
          is_told(line) ? html_text(in_words(line.moved)) : "",
          is_told(line) ? html_text(in_words(line.now)) : "",
          fmt::format("{:.4f}", to_mm(line.alone_before)), html_text(outcome_in_words(line))},
         line.helped == LineOutcome::Helped::kPutRight ? "" : "stands_out"});
  std::string text = fmt::format(
      "<p>Beyond what touching frames takes away, the drawing was off by {:.4f} mm rms at these "
      "poses by model {}, and is now by {:.4f} mm.</p>",
      to_mm(repair.before.beyond_frames.error_rms), html_text(repair.model),
      to_mm(repair.now.beyond_frames.error_rms));
  if (!rows.empty())
    text += html_table(
        {"budget stacks",
         {"line", "before ± U (k = 2)", "moved by", "now", "alone before, mm rms", "did it help"},
         rows});
  return html_section("Since the repair: did it help?", text);
}

}  // namespace trammel
