#include "clients/cli/files/program_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <set>

#include "clients/cam/backup/backup.h"
#include "clients/cam/mark.h"
#include "clients/cam/stated_robot.h"
#include "clients/cli/files/controller_files.h"
#include "clients/programs/given_poses.h"
#include "clients/programs/model_tools.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/compensate/model_file.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

constexpr const char* kOfPolyScope = ".urp";  // of Universal Robots

struct Found {
  std::string name, path;
};

/// The dialect by the ending. `.dat` is KRL only if its content looks like it, since FANUC's and
/// Yaskawa's controllers have such files too.
std::optional<cam::Dialect> dialect_of_found(const std::string& path) {
  const auto dialect = cam::dialect_of_file(path);
  const std::string ending = fs::path(path).extension().string();
  if (dialect != cam::Dialect::kKrl || (ending != ".dat" && ending != ".DAT" && ending != ".Dat"))
    return dialect;
  constexpr std::size_t kHead = 1 << 16;  // bytes
  std::string head(kHead, ' ');
  std::ifstream file(path, std::ios::binary);
  head.resize(static_cast<std::size_t>(file.read(head.data(), kHead).gcount()));
  std::erase(head, '\0');  // of UTF-16
  return upper(head).find("DEFDAT") == std::string::npos ? std::nullopt : dialect;
}

/// The programs of a folder, by name.
std::vector<Found> programs_in(const std::string& folder,
                               const std::optional<cam::Dialect>& wanted) {
  std::vector<Found> found;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    if (!it->is_regular_file(error)) continue;
    const std::string path = it->path().string();
    const auto dialect = dialect_of_found(path);
    if (dialect && (!wanted || dialect == wanted))
      found.push_back({fs::relative(it->path(), folder, error).string(), path});
  }
  std::sort(found.begin(), found.end(),
            [](const Found& a, const Found& b) { return a.name < b.name; });
  return found;
}

/// Keeps those below the folder of a task, and returns the others.
std::vector<Found> keep_task(const std::string& task, std::vector<Found>& programs) {
  const auto others =
      std::stable_partition(programs.begin(), programs.end(), [&](const Found& program) {
        const fs::path path(program.name);
        return std::any_of(path.begin(), path.end(), [&](const fs::path& part) {
          return lower(part.string()) == lower(task);
        });
      });
  std::vector<Found> left(std::make_move_iterator(others), std::make_move_iterator(programs.end()));
  programs.erase(others, programs.end());
  return left;
}

Status read_into(std::vector<cam::SourceFile>& files, const std::vector<Found>& found) {
  for (const Found& file : found) {
    cam::DecodedText read = TRY(read_program_text(file.path));
    files.push_back({file.name, std::move(read.text)});
  }
  return {};
}

Result<std::string> standard_input() {
  std::string text{std::istreambuf_iterator<char>(std::cin), {}};
  if (text.size() > kLargestProgram)
    return failure(ErrorCode::kTooLarge, "more than {} bytes", kLargestProgram)
        .in("standard input");
  return text;
}

bool same_file(const std::string& a, const std::string& b) {
  std::error_code error;
  const auto place = [&](const std::string& path) {
    return fs::weakly_canonical(fs::absolute(path, error), error);
  };
  return fs::equivalent(a, b, error) || place(a) == place(b);
}

/// Refuses a file of unknown kind.
Status check_kind(const std::string& path, bool is_said) {
  if (lower(fs::path(path).extension().string()) == kOfPolyScope)
    return refused("PolyScope's own program is not read")
        .in(path)
        .next("hand over the .script that PolyScope saves beside it");
  if (is_said || cam::dialect_of_file(path)) return {};
  return failure(ErrorCode::kUsage, "what kind of program is it?")
      .in(path)
      .next(fmt::format("--format says it: {}", cam::dialect_names()));
}

}  // namespace

bool is_program(const std::vector<std::string>& inputs, const std::string& format) {
  if (!format.empty()) return format != "csv";
  if (inputs.size() == 1 && lower(fs::path(inputs[0]).extension().string()) == kOfPolyScope)
    return true;
  return inputs.size() != 1 || inputs[0] == "-" || fs::is_directory(inputs[0]) ||
         cam::dialect_of_file(inputs[0]).has_value();
}

namespace {

/// Adds the programs of a folder to `found`; those of other tasks go beside them.
Status take_folder(const std::string& folder, const std::optional<cam::Dialect>& wanted,
                   ProgramFiles& program, std::vector<Found>& found) {
  std::vector<Found> inside = programs_in(folder, wanted);
  if (inside.empty()) return refused("a folder without programs").in(folder);
  std::vector<Found> other_tasks;
  if (!program.task.empty()) other_tasks = keep_task(program.task, inside);
  if (inside.empty()) {
    return refused("no programs of a task {}", shown(program.task))
        .in(folder)
        .of("--task")
        .with_text(program.task);
  }
  TRY(read_into(program.beside, other_tasks));
  found.insert(found.end(), inside.begin(), inside.end());
  for (const Found& file : inside)
    if (is_of_the_controller(file.name)) program.system.insert(file.name);
  program.from_folder = true;
  return {};
}

}  // namespace

Result<ProgramFiles> read_program_files(const std::vector<std::string>& inputs,
                                        const std::string& format, const std::string& task) {
  ProgramFiles program;
  program.task = task;
  const std::optional<cam::Dialect> wanted = cam::dialect_called(format);
  if (!format.empty() && !wanted) {
    return failure(ErrorCode::kUsage, "--format '{}': known are csv, {}", format,
                   cam::dialect_names())
        .of("--format")
        .with_text(format);
  }
  std::vector<Found> found;
  std::vector<std::string> folders;
  for (const std::string& input : inputs) {
    std::error_code error;
    if (fs::is_directory(input, error)) {
      TRY(take_folder(input, wanted, program, found));
      folders.push_back(input);
    } else {
      found.push_back(
          {input == "-" ? "standard input" : fs::path(input).filename().string(), input});
    }
  }
  std::optional<cam::Dialect> dialect = wanted;
  std::set<std::string> names;
  for (const Found& file : found) {
    const auto own = cam::dialect_of_file(file.path);
    TRY(check_kind(file.path, wanted.has_value()));
    if (!wanted && dialect && own != dialect) {
      return failure(ErrorCode::kUsage, "a {} program beside a {} one", cam::name_of(*own),
                     cam::name_of(*dialect))
          .in(file.path)
          .next("hand over one program at a time, or choose with --format");
    }
    if (!dialect) dialect = own;
    if (!names.insert(file.name).second)
      return refused("two files of the name {}", file.name).in(file.path);
    cam::DecodedText read =
        TRY(file.path == "-" ? standard_input().map(cam::decoded) : read_program_text(file.path));
    program.files.push_back({file.name, std::move(read.text)});
    program.paths.push_back(file.path);
    program.encodings.push_back(read.encoding);
  }
  program.dialect = dialect.value_or(cam::Dialect::kRapid);
  for (const std::string& folder : folders) {
    TRY(read_values(folder, program));
  }
  return program;
}

namespace {

/// Six numbers, of a Yaskawa job.
Status check_pulses(const ProgramFiles& files, const std::vector<double>& pulses_per_deg) {
  constexpr std::size_t kAxes = 6;
  constexpr double kLeast = 1e-3;
  if (pulses_per_deg.empty()) return {};
  const auto fail = [](std::string what) {
    return failure(ErrorCode::kUsage, "{}", what).of("--pulses-per-deg");
  };
  if (files.dialect != cam::Dialect::kInform)
    return fail(fmt::format("a {} program has no pulses", cam::name_of(files.dialect)));
  if (pulses_per_deg.size() != kAxes)
    return fail(fmt::format("{} numbers, 6 are due", pulses_per_deg.size()));
  for (const double number : pulses_per_deg) {
    if (!(std::abs(number) >= kLeast) || !std::isfinite(number))
      return fail("an axis without pulses to a degree");
  }
  return {};
}

/// The robots that an ABB backup names.
Result<std::vector<cam::ControllerRobot>> robots_of(const ProgramFiles& files) {
  std::vector<cam::ControllerRobot> robots;
  for (const cam::SourceFile& parameters : files.parameters) {
    auto robot = TRY(cam::read_controller_robot(parameters.text, parameters.name,
                                                cam::unit_of_task(parameters.text, files.task),
                                                "--task says which"));
    robots.push_back(std::move(robot));
  }
  return robots;
}

}  // namespace

Result<cam::Program> understood_program(const ProgramFiles& files, cam::ReadOptions options,
                                        const std::string& frames) {
  TRY(check_pulses(files, options.pulses_per_deg));
  const auto robots = TRY(robots_of(files));
  for (const cam::ControllerRobot& robot : robots)
    cam::take_stated(cam::stated_by(robot), options.stated);
  std::vector<cam::GivenPose> rows;
  options.beside = files.beside;
  if (is_listing(frames)) {
    options.beside.push_back(TRY(read_listing(frames, files.dialect)));
  } else if (!frames.empty()) {
    const std::string text = TRY(read_text_file(frames));
    rows = TRY(cam::read_given_poses(text, frames));
  }
  for (const cam::GivenPose& row : rows) options.frames.emplace(row.name, row.X);
  cam::Program program = cam::read_program(files.dialect, files.files, options);
  TRY(cam::check_files(program));
  for (const cam::ControllerRobot& robot : robots) {
    if (!robot.carried_by.empty())
      program.notes.push_back(fmt::format(
          "{} line {}: {} carries {}, so that where the robot stands is not taken from there",
          robot.file, robot.line, shown(robot.carried_by), shown(robot.unit)));
  }
  program.notes.insert(program.notes.end(), files.not_read.begin(), files.not_read.end());
  TRY(cam::take_idle_axes(program, options.idle_axes));
  if (program.is_understood()) {
    TRY(cam::check_used(rows, frames, program, files.dialect));
    return program;
  }
  return cam::no_motion_in(files.files, files.dialect,
                           files.paths.front() == "-" ? "standard input" : files.paths.front());
}

Status take_pulses(const ProgramFiles& files, const std::string& model, cam::ReadOptions& options) {
  if (files.dialect != cam::Dialect::kInform || !options.pulses_per_deg.empty()) return {};
  const CompensatedModel of_robot = TRY(load_model(model));
  options.pulses_per_deg = TRY(cam::pulses_of_job(of_robot.cell()));
  return {};
}

Result<ProgramFiles> originals_of(const ProgramFiles& program, bool all) {
  ProgramFiles before = program;
  bool any = false;
  for (std::size_t k = 0; k < before.files.size(); ++k) {
    const auto mark = cam::find_mark(before.files[k].text);
    if (!mark) continue;
    any = true;
    const std::string kept = cam::original_path(before.paths[k]);
    Result<cam::DecodedText> original = before.paths[k] == "-"
                                            ? Result<cam::DecodedText>(refused("not kept"))
                                            : read_program_text(kept);
    if (!original) {
      return refused("its original is not kept beside it as {}", fs::path(kept).filename().string())
          .in(before.paths[k])
          .next("fetch it from where it was corrected");
    }
    if (cam::short_hash(original->text) != mark->original)
      return refused("it is not what {} was corrected from: the mark names other bytes",
                     before.files[k].name)
          .in(kept);
    before.files[k].text = std::move(original->text);
    before.encodings[k] = original->encoding;
  }
  if (!any && !all)
    return refused("no mark of a correction").in(program.paths.front()).next("it is as it was");
  return before;
}

Result<std::vector<std::string>> output_paths(const ProgramFiles& program,
                                              const std::string& output) {
  std::vector<std::string> paths;
  std::error_code error;
  const bool folder = program.files.size() > 1 || program.from_folder ||
                      fs::is_directory(output, error) || output.ends_with('/');
  if (folder && output == "-") {
    return failure(ErrorCode::kUsage, "{} files do not go to standard output", program.files.size())
        .of("--output")
        .next("name a folder");
  }
  if (folder && fs::exists(output, error) && !fs::is_directory(output, error)) {
    return failure(ErrorCode::kUsage, "a folder is needed for {} files", program.files.size())
        .in(output)
        .of("--output");
  }
  for (std::size_t k = 0; k < program.files.size(); ++k) {
    paths.push_back(folder ? (fs::path(output) / program.files[k].name).string() : output);
    for (const std::string& input : program.paths) {
      if (output == "-" || input == "-" || !same_file(paths.back(), input)) continue;
      return failure(ErrorCode::kUsage, "--output {} would overwrite what it is made from",
                     paths.back())
          .of("--output")
          .with_text(paths.back());
    }
  }
  return paths;
}

}  // namespace trammel::cli
