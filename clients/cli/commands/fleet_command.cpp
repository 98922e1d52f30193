#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/json_guard.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/report/fleet_json.h"
#include "server/report/fleet_page.h"
#include "server/report/pages_beside.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

struct FleetArguments {
  std::vector<std::string> models;
  std::string json, report;
  ServiceOptions service;
};

Result<ordered_json> fleet_of_files(const std::vector<std::string>& paths) {
  std::vector<FleetEntry> cells;
  for (const std::string& path : paths) {
    CompensatedModel model = TRY(load_model(path));
    cells.push_back({path, 0, std::move(model), ""});
  }
  return fleet_json(cells, unix_now());
}

/// The answers of every server; their bytes come from outside.
Result<ordered_json> fleet_of_service(const FleetArguments& arguments) {
  const auto session = TRY(open_session(arguments.service));
  const auto texts = TRY(session->fleet());
  ordered_json all = {{"cells", ordered_json::array()}, {"types", ordered_json::array()}};
  for (const std::string& text : texts) {
    TRY(check_json_limits(text, "the service's fleet"));
    const ordered_json one = ordered_json::parse(text, nullptr, false);
    for (const char* key : {"cells", "types"}) {
      if (!one.is_object() || !one.contains(key) || !one[key].is_array())
        return failure(ErrorCode::kInternal, "the service's fleet has no {}", key);
      for (const ordered_json& entry : one[key]) all[key].push_back(entry);
    }
  }
  return all;
}

Status fleet(const FleetArguments& arguments) {
  if (arguments.models.empty() == !arguments.service.service) {
    return failure(ErrorCode::kUsage, "either --model, once for each robot, or --service")
        .of("--model");
  }
  Outputs outputs;
  outputs.add("--report", arguments.report);
  outputs.add("--json", arguments.json);
  TRY(outputs.check({}));
  const ordered_json json = TRY(arguments.service.service ? fleet_of_service(arguments)
                                                          : fleet_of_files(arguments.models));
  if (!arguments.report.empty()) {
    const std::string page = with_pages_beside(fleet_page(json, unix_now()), arguments.report);
    TRY(write_output(arguments.report, page));
  }
  try {
    tell(fleet_text(json), {arguments.json, arguments.report});
  } catch (const ordered_json::exception& error) {
    return failure(ErrorCode::kInternal, "the service's fleet is none: {}", error.what());
  }
  return write_json(arguments.json, json);
}

}  // namespace

void add_fleet_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<FleetArguments>();
  CLI::App* command = app.add_subcommand(
      "fleet", "List cells, their health, and what is unusual about each among robots of its type");
  command->add_option("--model", arguments->models,
                      "Model file of a robot, once for each; or --service");
  command
      ->add_option("--report", arguments->report, "Page to write (HTML); opens without a network")
      ->type_name("FILE");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return fleet(*arguments); }; });
}

}  // namespace trammel::cli
