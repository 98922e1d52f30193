#include "server/compensate/file/budget_values.h"

namespace trammel::model_file {

namespace {

Json json_of(const BudgetNumber& number) {
  return {
      {"name", number.name}, {"value", number.value}, {"u95", number.u95}, {"unit", number.unit}};
}

BudgetNumber number_of_line(const Json& json) {
  return {json.at("name").get<std::string>(), number_from(json, "value"), number_from(json, "u95"),
          json.at("unit").get<std::string>()};
}

/// The members of a line that a view does not change.
Json json_of(const BudgetLine& line) {
  Json json = {{"line", line.line},
               {"kind", to_string(line.kind)},
               {"name", line.name},
               {"alone_rms_m", line.alone_rms},
               {"alone_max_m", line.alone_max},
               {"share", line.share},
               {"left_m", line.left_if_right}};
  if (!line.cause.empty()) json["cause"] = line.cause;
  if (line.joint >= 0) json["joint"] = line.joint + 1;
  if (line.value) json["value"] = json_of(*line.value);
  for (const BudgetNumber& number : line.numbers) json["numbers"].push_back(json_of(number));
  if (line.times_usual) json["times_usual"] = *line.times_usual;
  if (!line.with.empty()) json["with"] = line.with;
  if (!line.action.empty()) json["action"] = line.action;
  if (!line.since_session.empty()) json["since_session"] = line.since_session;
  return json;
}

BudgetLine line_from(const Json& json) {
  BudgetLine line;
  line.line = json.at("line").get<std::string>();
  const std::string spelled = json.at("kind").get<std::string>();
  const std::optional<LineKind> kind = line_kind(spelled);
  if (!kind) wrong("expected the kind of a line of a budget", json.at("kind"));
  line.kind = *kind;
  line.name = json.at("name").get<std::string>();
  line.alone_rms = number_from(json, "alone_rms_m");
  line.alone_max = number_from(json, "alone_max_m");
  line.share = number_from(json, "share");
  line.left_if_right = number_from(json, "left_m");
  line.cause = json.value("cause", "");
  line.joint = json.contains("joint") ? whole_from<int>(json, "joint") - 1 : -1;
  if (json.contains("value")) line.value = number_of_line(json.at("value"));
  if (json.contains("numbers"))
    for (const Json& number : list_from(json.at("numbers")))
      line.numbers.push_back(number_of_line(number));
  if (json.contains("times_usual")) line.times_usual = number_from(json, "times_usual");
  line.with = json.value("with", std::vector<std::string>{});
  line.action = json.value("action", "");
  line.since_session = json.value("since_session", "");
  return line;
}

Json json_of(const std::vector<BudgetLine>& all) {
  Json lines = Json::array();
  for (const BudgetLine& line : all) lines.push_back(json_of(line));
  return lines;
}

Json json_of(const BudgetView& view) {
  return {{"error_rms_m", view.error_rms}, {"lines", json_of(view.lines)}};
}

BudgetView view_from(const Json& json) {
  BudgetView view;
  view.error_rms = number_from(json, "error_rms_m");
  for (const Json& line : list_from(json.at("lines"))) view.lines.push_back(line_from(line));
  return view;
}

}  // namespace

Json budget_json(const ErrorBudget& budget) {
  Json steps = Json::array();
  for (const PutRight& step : budget.put_right)
    steps.push_back({{"step", step.step}, {"name", step.name}, {"left_m", step.left_rms}});
  Json json = {{"poses", budget.poses},
               {"as_it_stands", json_of(budget.as_it_stands)},
               {"beyond_frames", json_of(budget.beyond_frames)},
               {"put_right", std::move(steps)}};
  if (!budget.between_sessions.empty()) json["between_sessions"] = json_of(budget.between_sessions);
  return json;
}

ErrorBudget budget_from(const Json& json) {
  ErrorBudget budget{count_from(json, "poses"),
                     view_from(json.at("as_it_stands")),
                     view_from(json.at("beyond_frames")),
                     {},
                     {}};
  for (const Json& step : list_from(json.at("put_right")))
    budget.put_right.push_back({step.at("step").get<std::string>(),
                                step.at("name").get<std::string>(), number_from(step, "left_m")});
  if (json.contains("between_sessions"))
    for (const Json& line : list_from(json.at("between_sessions")))
      budget.between_sessions.push_back(line_from(line));
  return budget;
}

}  // namespace trammel::model_file
