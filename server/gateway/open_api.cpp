#include "server/gateway/open_api.h"

#include <initializer_list>
#include <sstream>
#include <type_traits>
#include <utility>
#include <vector>

#include "server/exchange/columns.h"
#include "server/gateway/routes.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

ordered_json typed(const char* type) { return {{"type", type}}; }
ordered_json list_of(ordered_json items) {
  return {{"type", "array"}, {"items", std::move(items)}};
}
ordered_json schema_named(const std::string& name) {
  return {{"$ref", "#/components/schemas/" + name}};
}
ordered_json number_or_null() { return {{"type", {"number", "null"}}}; }

/// An object with these members, the first `needed` of which must be there.
ordered_json object_of(std::initializer_list<std::pair<const char*, ordered_json>> members,
                       std::size_t needed, bool others = false) {
  ordered_json schema = {{"type", "object"}, {"properties", ordered_json::object()}};
  ordered_json required = ordered_json::array();
  for (const auto& [name, member] : members) {
    schema["properties"][name] = member;
    if (required.size() < needed) required.push_back(name);
  }
  if (!required.empty()) schema["required"] = required;
  schema["additionalProperties"] = others;
  return schema;
}

ordered_json pose_schema() {
  ordered_json schema = object_of({}, 0);
  exchange::each_column(
      exchange::kPoseColumns, exchange::Pose(),
      [&](const std::string& name, double) { schema["properties"][name] = typed("number"); });
  return schema;
}

/// Adds a member for every figure that JSON has.
template <typename Answer, typename Figures>
void add_figures(const Figures& figures, ordered_json& schema) {
  exchange::each_figure(figures, [&](const auto& figure) {
    if (figure.place == exchange::Place::kNowhere) return;
    using Value = std::decay_t<decltype(Answer().*figure.value)>;
    ordered_json& members = schema["properties"];
    if constexpr (std::is_same_v<Value, exchange::Pose>) {
      members[figure.name] = schema_named("Pose");
    } else if constexpr (std::is_same_v<Value, bool>) {
      members[figure.columns] = typed("boolean");
    } else if constexpr (std::is_integral_v<Value>) {
      members[figure.columns] = typed("integer");
    } else {
      exchange::each_column(
          figure.columns, Answer().*figure.value,
          [&](const std::string& name, double) { members[name] = number_or_null(); });
    }
  });
}

ordered_json approach_members(ordered_json schema) {
  schema["properties"]["directions"] = list_of({{"type", "integer"}, {"enum", {-1, 0, 1}}});
  schema["properties"]["temperature_c"] = typed("number");
  schema["properties"]["time_s"] = typed("number");
  return schema;
}

/// A question about the model of a cell.
ordered_json question(const char* list, ordered_json items) {
  ordered_json schema = object_of({{list, list_of(std::move(items))}}, 1);
  for (const char* name : {"tool", "payload", "model"})
    schema["properties"][name] = typed("string");
  schema["properties"]["controller_compensates"] = typed("boolean");
  return schema;
}

ordered_json asked_schemas() {
  ordered_json joints =
      object_of({{"joints_deg", list_of(typed("number"))}, {"pose_id", typed("string")}}, 1);
  ordered_json target = pose_schema();
  target["properties"]["name"] = typed("string");
  target["properties"]["conf"] = {{"type", "integer"}, {"minimum", 0}, {"maximum", 7}};
  target["properties"]["joints_deg"] = list_of(typed("number"));
  ordered_json predict = question("poses", approach_members(std::move(joints)));
  predict["properties"]["covariance"] = typed("boolean");
  predict["properties"]["orientation"] = typed("boolean");
  const ordered_json file = object_of(
      {{"name", typed("string")}, {"base64", {{"type", "string"}, {"contentEncoding", "base64"}}}},
      2);
  return {{"PredictRequest", predict},
          {"CorrectRequest", question("targets", approach_members(std::move(target)))},
          {"ProgramRequest", object_of({{"files", list_of(file)},
                                        {"format", typed("string")},
                                        {"tool", typed("string")},
                                        {"payload", typed("string")},
                                        {"keep_digits", typed("boolean")},
                                        {"frames", typed("string")}},
                                       1)},
          {"ActivateRequest", object_of({{"version", typed("integer")},
                                         {"force", typed("boolean")},
                                         {"expected_version", typed("integer")},
                                         {"reason", typed("string")},
                                         {"change_id", typed("string")}},
                                        1)},
          {"RollbackRequest", object_of({{"expected_version", typed("integer")},
                                         {"reason", typed("string")},
                                         {"change_id", typed("string")}},
                                        0)},
          {"TrainRequest", object_of({{"batch_ids", list_of(typed("string"))},
                                      {"level", typed("string")},
                                      {"bias", typed("string")},
                                      {"change_id", typed("string")}},
                                     0)}};
}

ordered_json told_schemas() {
  ordered_json prediction = object_of({}, 0);
  add_figures<exchange::Prediction>(exchange::kPredictionFigures, prediction);
  prediction["properties"]["pose_id"] = typed("string");
  ordered_json correction = object_of({{"status", typed("string")},
                                       {"message", typed("string")},
                                       {"name", typed("string")},
                                       {"commanded", schema_named("Pose")},
                                       {"joints", typed("object")}},
                                      2);
  add_figures<exchange::CorrectedTarget>(exchange::kCorrectionFigures, correction);
  const ordered_json any = typed("object");
  const ordered_json notes = list_of(any);
  return {
      {"Pose", pose_schema()},
      {"Predictions",
       object_of(
           {{"model", typed("string")}, {"notes", notes}, {"predictions", list_of(prediction)}},
           3)},
      {"Corrections",
       object_of({{"model", typed("string")}, {"notes", notes}, {"targets", list_of(correction)}},
                 3)},
      {"Program", object_of({{"model", typed("string")},
                             {"files", list_of(any)},
                             {"summary", typed("string")},
                             {"receipt", any},
                             {"receipt_csv", typed("string")}},
                            5)},
      {"Queued", object_of({{"job", typed("integer")}}, 1)},
      {"Model", any},
      {"Models", object_of({{"cell", typed("string")}, {"models", list_of(any)}}, 2)},
      {"Job", any},
      {"Jobs", object_of({{"jobs", list_of(any)}}, 1)},
      {"Findings", any},
      {"Status", any},
      {"Error", object_of({{"error", any}}, 1)}};
}

/// `application/json Jobs`
ordered_json content_of(const std::string& spelled) {
  std::istringstream words(spelled);
  std::string type, schema;
  words >> type >> schema;
  ordered_json content = ordered_json::object();
  content[type] = ordered_json::object();
  if (!schema.empty()) content[type]["schema"] = schema_named(schema);
  return content;
}

ordered_json parameters_of(const Route& route) {
  ordered_json parameters = ordered_json::array();
  for (const char* name : {"cell", "job"}) {
    if (std::string(route.path).find("{" + std::string(name) + "}") != std::string::npos)
      parameters.push_back({{"name", name},
                            {"in", "path"},
                            {"required", true},
                            {"schema", typed(name == std::string("job") ? "integer" : "string")}});
  }
  for (const RouteOption& option : route.options)
    parameters.push_back({{"name", option.name},
                          {"in", "query"},
                          {"required", option.needed},
                          {"description", option.what},
                          {"schema", typed(option.type)}});
  if (*route.takes != '\0')
    parameters.push_back({{"name", "Trammel-Deadline-Ms"},
                          {"in", "header"},
                          {"required", false},
                          {"description", "how long the client waits"},
                          {"schema", typed("integer")}});
  return parameters;
}

ordered_json operation_of(const Route& route) {
  ordered_json operation = {{"summary", route.what},
                            {"x-role", to_text(route.role)},
                            {"parameters", parameters_of(route)}};
  if (*route.takes != '\0')
    operation["requestBody"] = {{"required", true}, {"content", content_of(route.takes)}};
  operation["responses"]["200"] = {{"description", "done"}, {"content", content_of(route.gives)}};
  operation["responses"]["default"] = {{"description", "refused: code, words, value and limit"},
                                       {"content", content_of("application/json Error")}};
  return operation;
}

}  // namespace

ordered_json open_api(const std::string& version) {
  ordered_json paths = ordered_json::object();
  for (const Route& route : routes())
    paths[route.path][route.method == std::string("GET") ? "get" : "post"] = operation_of(route);
  ordered_json schemas = asked_schemas();
  schemas.update(told_schemas());
  return {{"openapi", "3.1.0"},
          {"info", {{"title", "Trammel"}, {"version", version}}},
          {"servers", {{{"url", "/api/v1"}}}},
          {"security", {{{"token", ordered_json::array()}}, ordered_json::object()}},
          {"paths", paths},
          {"components",
           {{"securitySchemes", {{"token", {{"type", "http"}, {"scheme", "bearer"}}}}},
            {"schemas", schemas}}}};
}

}  // namespace trammel
