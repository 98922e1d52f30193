#include "server/report/budget_json.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/budget/remedies.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

ordered_json number_or_null(double number) {
  return std::isfinite(number) ? ordered_json(number) : ordered_json(nullptr);
}

}  // namespace

ordered_json budget_line_json(const BudgetLine& line) {
  ordered_json json = {{"line", line.line},
                       {"kind", line.cause_or_kind()},
                       {"name", line.name},
                       {"joint", nullptr},
                       {"value", nullptr},
                       {"u95", nullptr},
                       {"unit", nullptr},
                       {"alone_rms_mm", number_or_null(to_mm(line.alone_rms))},
                       {"alone_max_mm", number_or_null(to_mm(line.alone_max))},
                       {"share", number_or_null(line.share)},
                       {"left_if_right_mm", number_or_null(to_mm(line.left_if_right))},
                       {"times_usual", nullptr},
                       {"with", line.with},
                       {"action", line.action}};
  if (line.joint >= 0) json["joint"] = line.joint + 1;
  if (line.value) {
    json["value"] = line.value->value;
    json["u95"] = line.value->u95;
    json["unit"] = line.value->unit;
  }
  if (line.times_usual) json["times_usual"] = *line.times_usual;
  if (!line.since_session.empty()) json["since_session"] = line.since_session;
  if (!line.numbers.empty()) json["numbers"] = ordered_json::array();
  for (const BudgetNumber& number : line.numbers)
    json["numbers"].push_back({{"name", number.name},
                               {"value", number.value},
                               {"u95", number.u95},
                               {"unit", number.unit}});
  return json;
}

ordered_json budget_view_json(const BudgetView& view) {
  const auto size = [](const BudgetLine& line) {
    return std::isfinite(line.alone_rms) ? line.alone_rms : -1.0;
  };
  ordered_json lines = ordered_json::array();
  std::vector<BudgetLine> largest_first = view.lines;
  std::stable_sort(
      largest_first.begin(), largest_first.end(),
      [&](const BudgetLine& one, const BudgetLine& other) { return size(one) > size(other); });
  for (const BudgetLine& line : largest_first) lines.push_back(budget_line_json(line));
  return {{"nominal_rms_mm", to_mm(view.error_rms)}, {"lines", std::move(lines)}};
}

ordered_json budget_json(const ErrorBudget& budget) {
  ordered_json json = budget_view_json(budget.as_it_stands);
  json["poses"] = budget.poses;
  json["beyond_frames"] = budget_view_json(budget.beyond_frames);
  json["sentences"] = in_words(budget);
  if (!budget.between_sessions.empty()) json["between_sessions"] = ordered_json::array();
  for (const BudgetLine& line : budget.between_sessions)
    json["between_sessions"].push_back(budget_line_json(line));
  return json;
}

ordered_json remedy_steps_json(const ErrorBudget& budget) {
  ordered_json steps = ordered_json::array();
  for (const PutRight& step : budget.put_right) {
    if (step.step == "nothing") continue;
    ordered_json values = ordered_json::array();
    for (const RemedyValue& value : remedy_values(budget, step.step))
      values.push_back(
          {{"name", value.name}, {"add", value.add}, {"u95", value.u95}, {"unit", value.unit}});
    steps.push_back({{"step", step.step},
                     {"name", step.name},
                     {"left_rms_mm", to_mm(step.left_rms)},
                     {"values", std::move(values)}});
  }
  return steps;
}

}  // namespace trammel
