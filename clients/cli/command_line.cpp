#include "clients/cli/command_line.h"

#include <CLI/CLI.hpp>
#include <sstream>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/command_tree.h"
#include "clients/cli/terminal/defaults.h"
#include "clients/cli/terminal/help_topics.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/terminal/spared_inputs.h"
#include "clients/cli/terminal/usage.h"
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
std::string json_path_in(const CLI::App& app, const std::vector<std::string>& words) {
  const auto prints_table = [&](const CLI::App* one) {
    return !words.empty() && one->get_name() == words[0] &&
           one->get_option_no_throw("--form") != nullptr;
  };
  const bool has_form = !app.get_subcommands(prints_table).empty();
  for (std::size_t k = 0; k < words.size(); ++k) {
    const bool is_form = has_form && (words[k] == "-o" || words[k] == "--form");
    if (is_form && k + 1 < words.size() && words[k + 1] == "json") return "-";
    if (words[k].starts_with("--json=")) return words[k].substr(7);
    if (words[k] == "--json" && k + 1 < words.size()) return words[k + 1];
  }
  return "";
}

/// Prints one line for each error on standard error; also JSON, if it was requested on standard
/// output.
int tell_errors(const CLI::App& app, const Error& error, const std::string& command,
                const std::vector<std::string>& words) {
  const std::string name = command.empty() ? "trammel" : "trammel " + command;
  for (const Error& one : apart(error))
    fmt::print(stderr, "{}: {}\n", emphasised(name), sentence(one));
  tell_refusal(error, json_path_in(app, words));
  return exit_code(error.code);
}

/// Prints help or the version.
int tell_help(const CLI::App& app, const CLI::ParseError& asked) {
  std::ostringstream out, err;
  app.exit(asked, out, err);
  fmt::print("{}", shown_lines(out.str()));
  return 0;
}

void add_commands(CLI::App& app, Action& chosen) {
  add_plan_command(app, chosen);
  add_view_command(app, chosen);
  add_pose_commands(app, chosen);
  add_measurement_commands(app, chosen);
  add_model_commands(app, chosen);
  add_apply_commands(app, chosen);
  add_check_command(app, chosen);
  add_diagnose_command(app, chosen);
  add_remedies_command(app, chosen);
  add_compare_command(app, chosen);
  add_backup_command(app, chosen);
  add_setup_command(app, chosen);
  add_robot_command(app, chosen);
  add_confirm_command(app, chosen);
  add_structure_commands(app, chosen);
  add_fleet_command(app, chosen);
  add_study_command(app, chosen);
  add_service_commands(app, chosen);
  add_audit_command(app, chosen);
  add_store_backup_command(app, chosen);
  add_store_command(app, chosen);
  add_history_command(app, chosen);
  add_replay_command(app, chosen);
  add_doctor_command(app, chosen);
  add_help_commands(app, chosen);
}

}  // namespace

void make_command_line(CLI::App& app, Action& chosen) {
  app.name("trammel");
  app.set_version_flag("--version", TRAMMEL_VERSION);
  app.require_subcommand(0, 1);
  app.footer(std::string(common_footer()));
  add_commands(app, chosen);
  for (CLI::App* command :
       app.get_subcommands([](CLI::App* one) { return !one->get_name().empty(); })) {
    const std::string examples(examples_of(command->get_name()));
    command->footer((examples.empty() ? "" : "Examples:\n" + examples + "\n\n") +
                    std::string(common_footer()));
  }
  set_help_format(app);
  need_finite_numbers(app);
}

int run_command_line(int argc, const char* const* argv) {
  CLI::App app(
      "Makes an industrial robot land where it was told to: measure, calibrate, learn, correct.",
      "trammel");
  Action chosen;
  make_command_line(app, chosen);
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  const std::string name = words.empty() || words[0].starts_with('-') ? "" : words[0];
  if (const auto unknown = unknown_word(app, words)) {
    const bool no_command = unknown->field == "command";
    return tell_errors(app, *unknown, no_command ? "" : name, words);
  }
  const Result<std::vector<std::string>> all = with_defaults(app, words, defaults_path());
  if (!all) return tell_errors(app, all.error(), name, words);
  try {
    app.parse(std::vector<std::string>(all->rbegin(),
                                       all->rend()));  // the parser takes them from the end
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return tell_help(app, error);
    return tell_errors(app, usage_error(app, error, name), name, words);
  }
  if (!chosen) {
    tell(std::string(overview()), {});
    return kNotAll;
  }
  const CLI::App& command = *app.get_subcommands().front();
  if (const auto empty = empty_word(command))
    return tell_errors(app, *empty, command.get_name(), words);
  if (const Status fine = check_outputs(command); !fine)
    return tell_errors(app, advised(fine.error(), command), command.get_name(), words);
  const Result<Extent> done = chosen();
  if (done) return *done == Extent::kAll ? 0 : kNotAll;
  return tell_errors(app, advised(done.error(), command), command.get_name(), words);
}

}  // namespace trammel::cli
