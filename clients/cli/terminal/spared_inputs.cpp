#include "clients/cli/terminal/spared_inputs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "server/robot/cell_file.h"

namespace trammel::cli {

namespace {

constexpr std::array<std::string_view, 6> kOutputs = {"--output",  "--json",      "--report",
                                                      "--receipt", "--residuals", "--next-poses"};
/// What a command may write over by design, or judges by itself.
constexpr std::array<std::string_view, 3> kJudgedElsewhere = {"--from", "--cell-out", "--store"};

struct Given {
  std::string option, path;
};

template <typename Names>
bool is_one_of(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The files that exist among what the options were given.
std::vector<Given> files_given(const CLI::App& command, bool outputs) {
  std::vector<Given> files;
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_name();
    if (is_one_of(kOutputs, name) != outputs || is_one_of(kJudgedElsewhere, name)) continue;
    for (const std::string& path : option->results()) {
      std::error_code error;
      if (std::filesystem::is_regular_file(path, error)) files.push_back({name, path});
    }
  }
  return files;
}

/// The robot files that cell files name.
std::vector<Given> robots_of(const std::vector<Given>& inputs) {
  std::vector<Given> robots;
  for (const Given& input : inputs) {
    if (input.option != "--cell") continue;
    if (const auto path = robot_path_of(input.path)) robots.push_back({"the robot file of --cell", *path});
  }
  return robots;
}

}  // namespace

Status check_inputs_are_spared(const CLI::App& command) {
  std::vector<Given> inputs = files_given(command, false);
  for (Given& robot : robots_of(inputs)) inputs.push_back(std::move(robot));
  for (const Given& output : files_given(command, true)) {
    for (const Given& input : inputs) {
      std::error_code error;
      if (!std::filesystem::equivalent(output.path, input.path, error)) continue;
      return failure(ErrorCode::kUsage, "{} {} would overwrite {}", output.option, output.path, input.option)
          .of(output.option)
          .with_text(output.path)
          .next("name another file");
    }
  }
  return {};
}

}  // namespace trammel::cli
