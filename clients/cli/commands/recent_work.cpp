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
  const Result<ModelReference> model = parse_model_reference(reference);
  if (!model) return tl::make_unexpected(model.error());
  const auto session = open_session(service);
  if (!session) return tl::make_unexpected(session.error());
  const auto text = (*session)->replay(model->cell, model->version);
  if (!text) return tl::make_unexpected(text.error());
  if (const Status small = check_json_limits(*text, "the service's replay"); !small)
    return tl::make_unexpected(small.error());
  return ordered_json::parse(*text, nullptr, false);
}

}  // namespace

Result<double> tell_recent_work(const RecentWorkArguments& arguments, const ServiceOptions& service) {
  Outputs outputs;
  outputs.add("--next-poses", arguments.next_poses);
  outputs.add("--json", arguments.json);
  if (const Status good = outputs.check({}); !good) return tl::make_unexpected(good.error());
  const Result<ordered_json> json = asked_of_service(arguments.model, service);
  if (!json) return tl::make_unexpected(json.error());
  double differs_mm = 0;
  try {
    if (!json->at("other").is_null()) differs_mm = json->at("difference").at("max_mm").get<double>();
    tell(work_text(*json), {arguments.json, arguments.next_poses});
    if (!json->at("next_poses").empty()) outputs.put("--next-poses", next_poses_csv(*json));
  } catch (const ordered_json::exception& error) {
    return failure(ErrorCode::kInternal, "the service's replay is none: {}", error.what());
  }
  outputs.put("--json", json_text(*json));
  return outputs.write().map([&] { return differs_mm; });
}

}  // namespace trammel::cli
