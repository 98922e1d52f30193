#include "clients/cli/command_line.h"

#include <CLI/CLI.hpp>
#include <sstream>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/output.h"
#include "server/base/plain_text.h"

namespace trammel::cli {

namespace {

constexpr int kNotAll = 1;
constexpr int kWrongUsage = 2;
constexpr int kRefusedData = 3;
constexpr int kNoService = 4;

}  // namespace

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return kWrongUsage;
    case ErrorCode::kBusy:
    case ErrorCode::kUnreachable:
      return kNoService;
    case ErrorCode::kRefused:
    case ErrorCode::kNotFound:
    case ErrorCode::kConflict:
    case ErrorCode::kTooLarge:
    case ErrorCode::kInternal:
      return kRefusedData;
  }
  return kRefusedData;
}

namespace {

/// Where a command was asked to write its result for programs; empty where it was not.
std::string json_path_of(const CLI::App& command) {
  const CLI::Option* option = command.get_option_no_throw("--json");
  return option == nullptr || option->empty() ? std::string() : option->as<std::string>();
}

/// Prints help or what is wrong with the arguments, and returns the parser's own exit code.
int told(const CLI::App& app, const CLI::ParseError& error) {
  std::ostringstream out, err;
  const int code = app.exit(error, out, err);
  fmt::print("{}", shown_lines(out.str()));
  fmt::print(stderr, "{}", shown_lines(err.str()));
  return code;
}

}  // namespace

int run_command_line(int argc, const char* const* argv) {
  CLI::App app("Makes an industrial robot land where it was told to: measure, calibrate, learn, correct.", "trammel");
  app.set_version_flag("--version", TRAMMEL_VERSION);
  app.require_subcommand(0, 1);
  app.footer(
      "Joints are in deg (rails in mm), positions in mm, standard deviations in the unit of what they belong to.\n"
      "An output file named '-' is standard output. Errors go to standard error and name file, row, value and limit.\n"
      "Exit codes: 0 done; 1 done but not all (targets left as they were, a new model not in force); 2 wrong usage;\n"
      "3 refused data; 4 service unreachable or busy.");
  Action chosen;
  add_backup_command(app, chosen);
  add_plan_command(app, chosen);
  add_pose_commands(app, chosen);
  add_measurement_commands(app, chosen);
  add_structure_commands(app, chosen);
  add_model_commands(app, chosen);
  add_apply_commands(app, chosen);
  add_check_command(app, chosen);
  add_fleet_command(app, chosen);
  add_diagnose_command(app, chosen);
  add_study_command(app, chosen);
  add_service_commands(app, chosen);
  add_audit_command(app, chosen);
  add_store_backup_command(app, chosen);
  add_history_command(app, chosen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return told(app, error) == 0 ? 0 : kWrongUsage;
  }
  if (!chosen) {
    fmt::print(stderr, "A command is required\n{}", app.help());
    return kWrongUsage;
  }
  const CLI::App& command = *app.get_subcommands().front();
  const Result<Extent> done = chosen();
  if (done) return *done == Extent::kAll ? 0 : kNotAll;
  for (const Error& one : apart(done.error())) {
    fmt::print(stderr, "trammel {}: {}\n", command.get_name(), sentence(one));
  }
  tell_refusal(done.error(), json_path_of(command));
  return exit_code(done.error().code);
}

}  // namespace trammel::cli
