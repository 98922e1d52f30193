#include "clients/cli/terminal/spared_inputs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cli/files/program_files.h"
#include "clients/cli/terminal/output.h"
#include "server/base/text_file.h"
#include "server/robot/cell_file.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

/// The order in which two equal outputs are named.
constexpr std::array<std::string_view, 12> kOutputs = {
    "--output", "--robot-output", "--report", "--receipt",  "--residuals", "--next-poses",
    "--rapid",  "--krl",          "--fanuc",  "--urscript", "--frames",    "--json"};
/// The options whose files a command may write over by design, or judges by itself.
constexpr std::array<std::string_view, 2> kJudgedElsewhere = {"--cell-out", "--store"};

template <typename Names>
bool is_one_of(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// `import-backup` writes the frames that `correct` and `predict` read.
bool is_output(const CLI::App& command, const std::string& option) {
  return is_one_of(kOutputs, option) &&
         (option != "--frames" || command.get_name() == "import-backup");
}

bool is_input(const CLI::App& command, const std::string& option) {
  return !is_output(command, option) && !is_one_of(kJudgedElsewhere, option);
}

std::vector<NamedFile> outputs_of(const CLI::App& command) {
  std::vector<NamedFile> outputs;
  for (const std::string_view word : kOutputs) {
    const std::string name(word);
    const CLI::Option* option = command.get_option_no_throw(name);
    if (option == nullptr || !is_output(command, name)) continue;
    for (const std::string& path : option->results()) outputs.push_back({name, path});
  }
  return outputs;
}

/// The existing files among the values of the other options.
std::vector<NamedFile> inputs_of(const CLI::App& command) {
  std::vector<NamedFile> files;
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_name();
    if (!is_input(command, name)) continue;
    for (const std::string& path : option->results()) {
      std::error_code error;
      if (fs::is_regular_file(path, error)) files.push_back({name, path});
    }
  }
  return files;
}

/// The robot files that cell files name.
std::vector<NamedFile> robots_of(const std::vector<NamedFile>& inputs) {
  std::vector<NamedFile> robots;
  for (const NamedFile& input : inputs) {
    if (input.option != "--cell") continue;
    if (const auto path = robot_path_of(input.path))
      robots.push_back({"the robot file of --cell", *path});
  }
  return robots;
}

/// The folder that `correct` makes for a program's files; empty: it makes none.
std::string folder_of_program(const CLI::App& correct, const std::string& output) {
  const std::vector<std::string>& inputs = correct.get_option("input")->results();
  const auto& format = correct.get_option("--format")->results();
  if (!is_program(inputs, format.empty() ? "" : format.front()) || output == "-") return "";
  std::error_code error;
  const auto is_folder = [&](const std::string& path) { return fs::is_directory(path, error); };
  if (inputs.size() > 1 || output.ends_with('/') || is_folder(output) || is_folder(inputs.front()))
    return output;
  const std::string parent = fs::path(output).parent_path().string();
  return parent.empty() ? "." : parent;
}

/// The folder that the command makes if it is missing; empty: it makes none.
std::string folder_that_is_made(const CLI::App& command) {
  const std::string name = command.get_name();
  if (name != "correct" && name != "manual" && name != "setup") return "";
  const std::string output = command.get_option("--output")->as<std::string>();
  return name == "correct" ? folder_of_program(command, output) : output;
}

/// Checks that the folder is writable, or can be made. A file in its place is refused by the
/// command that needs the folder.
Status check_can_be_made(const std::string& folder) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_directory(folder, error)) return {};
  fs::path there = fs::weakly_canonical(fs::absolute(folder, error), error);
  while (!there.empty() && there != there.root_path() && !fs::exists(there, error))
    there = there.parent_path();
  const Status writable = check_writable((there / "a file").string());
  if (writable) return {};
  Error refusal = writable.error();
  refusal.file = folder;
  return Failure(std::move(refusal));
}

bool same_folder(const fs::path& a, const fs::path& b) {
  std::error_code error;
  const auto place = [&](const fs::path& folder) {
    return fs::weakly_canonical(fs::absolute(folder / "a file", error), error);
  };
  return place(a) == place(b);  // with or without a slash at the end
}

/// True if the output is, or lies in, a folder that the command makes.
bool comes_into(const std::string& made, const std::string& path) {
  if (made.empty()) return false;
  std::error_code error;
  if (fs::is_directory(made, error)) return same_folder(path, made);
  const fs::path parent = fs::path(path).parent_path();
  return same_folder(path, made) || same_folder(parent.empty() ? fs::path(".") : parent, made);
}

}  // namespace

Status check_outputs(const CLI::App& command) {
  std::vector<NamedFile> inputs = inputs_of(command);
  for (NamedFile& robot : robots_of(inputs)) inputs.push_back(std::move(robot));
  const std::string made = folder_that_is_made(command);
  Outputs apart, outputs;
  for (const NamedFile& output : outputs_of(command)) {
    const bool refits = command.get_name() == "train" && output.option == "--output";
    const std::string replaces = refits ? "--from" : "";
    apart.add(output.option, output.path, replaces);
    if (!comes_into(made, output.path)) outputs.add(output.option, output.path, replaces);
  }
  TRY(apart.check_apart(inputs));
  if (!made.empty()) {
    TRY(check_can_be_made(made));
  }
  return outputs.check(inputs);
}

}  // namespace trammel::cli
