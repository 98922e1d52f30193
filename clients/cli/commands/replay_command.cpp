#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/diagnose_text.h"
#include "server/base/json_guard.h"
#include "server/report/work_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

struct ReplayArguments {
  std::string model, json, next_poses;
  ServiceOptions service;
};

/// Its bytes come from outside.
Result<ordered_json> asked_of_service(const ReplayArguments& arguments) {
  const Result<ModelReference> model = parse_model_reference(arguments.model);
  if (!model) return tl::make_unexpected(model.error());
  const auto session = open_session(arguments.service);
  if (!session) return tl::make_unexpected(session.error());
  const auto text = (*session)->replay(model->cell, model->version);
  if (!text) return tl::make_unexpected(text.error());
  if (const Status small = check_json_limits(*text, "the service's replay"); !small)
    return tl::make_unexpected(small.error());
  return ordered_json::parse(*text, nullptr, false);
}

Status replay(const ReplayArguments& arguments) {
  Outputs outputs;
  outputs.add("--next-poses", arguments.next_poses);
  outputs.add("--json", arguments.json);
  if (const Status good = outputs.check({}); !good) return good;
  const Result<ordered_json> json = asked_of_service(arguments);
  if (!json) return tl::make_unexpected(json.error());
  try {
    tell(work_text(*json), {arguments.json, arguments.next_poses});
    if (!json->at("next_poses").empty()) outputs.put("--next-poses", next_poses_csv(*json));
  } catch (const ordered_json::exception& error) {
    return failure(ErrorCode::kInternal, "the service's replay is none: {}", error.what());
  }
  outputs.put("--json", json_text(*json));
  return outputs.write();
}

}  // namespace

void add_replay_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand(
      "replay",
      "Give the poses that a cell was lately asked for to another version of its model, and tell the difference");
  command->add_option("--model", arguments->model, "The cell's id, or cell@version to compare with what is in force")
      ->required();
  command->add_option("--next-poses", arguments->next_poses,
                      "Write the poses at work where the model in force is least sure (CSV; `plan --from` reads it)");
  add_json_option(*command, arguments->json);
  add_options_of_service_command(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return replay(*arguments); }; });
}

}  // namespace trammel::cli
