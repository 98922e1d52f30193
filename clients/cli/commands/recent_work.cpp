#include "clients/cli/commands/recent_work.h"

#include "clients/cli/terminal/output.h"
#include "clients/cli/text/diagnose_text.h"
#include "server/base/json_guard.h"
#include "server/report/work_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

/// Its bytes come from outside.
Result<ordered_json> asked_of_service(const std::string& reference, const ServiceOptions& service) {
  const ModelReference model = TRY(parse_model_reference(reference));
  const auto session = TRY(open_session(service));
  const auto text = TRY(session->replay(model.cell, model.version));
  TRY(check_json_limits(text, "the service's replay"));
  return ordered_json::parse(text, nullptr, false);
}

}  // namespace

Result<double> tell_recent_work(const RecentWorkArguments& arguments,
                                const ServiceOptions& service) {
  Outputs outputs;
  outputs.add("--next-poses", arguments.next_poses);
  outputs.add("--json", arguments.json);
  TRY(outputs.check({}));
  const ordered_json json = TRY(asked_of_service(arguments.model, service));
  double differs_mm = 0;
  try {
    if (!json.at("other").is_null()) differs_mm = json.at("difference").at("max_mm").get<double>();
    tell(work_text(json), {arguments.json, arguments.next_poses});
    if (!json.at("next_poses").empty()) outputs.put("--next-poses", next_poses_csv(json));
  } catch (const ordered_json::exception& error) {
    return failure(ErrorCode::kInternal, "the service's replay is none: {}", error.what());
  }
  outputs.put("--json", json_text(json));
  return outputs.write().map([&] { return differs_mm; });
}

}  // namespace trammel::cli
