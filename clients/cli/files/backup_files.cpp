#include "clients/cli/files/backup_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>
#include <vector>

#include "clients/cam/stated_robot.h"
#include "clients/cli/files/controller_files.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/files/shipped_files.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/robot/cell.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

/// The entry of a folder with this name, whatever its case: backups are copied by all kinds of
/// systems.
std::string inside(const std::string& folder, const std::string& name) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (lower(entry.path().filename().string()) == lower(name)) return entry.path().string();
  }
  return (fs::path(folder) / name).string();
}

std::string parameters_of(const std::string& folder) {
  return inside(inside(folder, "SYSPAR"), "MOC.cfg");
}

Result<std::vector<cam::SourceFile>> modules_of(const BackupPlace& place) {
  const std::string rapid = inside(place.folder, "RAPID");
  const std::string folder = place.task.empty() ? rapid : inside(rapid, place.task);
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    if (place.task.empty()) return std::vector<cam::SourceFile>{};
    return refused("no task {} in the backup", shown(place.task))
        .in(folder)
        .of("--task")
        .with_text(place.task);
  }
  bool any = false;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder, error))
    any |= cam::dialect_of_file(entry.path().string()) == cam::Dialect::kRapid;
  if (!any) return std::vector<cam::SourceFile>{};
  ProgramFiles files = TRY(read_program_files({folder}, cam::name_of(cam::Dialect::kRapid)));
  return std::move(files.files);
}

std::set<std::string> lists_of(cam::Dialect dialect) {
  std::set<std::string> names = cam::own_lists_of(dialect);
  names.merge(cam::type_files_of(dialect));
  return names;
}

/// The names of all files of a folder, in lower case.
std::set<std::string> names_in(const std::string& folder) {
  std::error_code error;
  std::set<std::string> names;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error))
    names.insert(lower(it->path().filename().string()));
  return names;
}

constexpr cam::Dialect kWithLists[] = {cam::Dialect::kKrl, cam::Dialect::kFanuc,
                                       cam::Dialect::kInform};
/// The same, those whose programs have an ending of their own first.
constexpr cam::Dialect kByPrograms[] = {cam::Dialect::kFanuc, cam::Dialect::kInform,
                                        cam::Dialect::kKrl};

/// As the controller names it; empty: it does not.
std::string type_of(const cam::ControllerCell& controller) {
  if (!controller.stated.types.empty()) return controller.stated.types.front().type;
  return controller.file.empty() ? "" : controller.robot_type;
}

bool has_rails(const Chain& robot) {
  for (int j = 0; j < robot.size(); ++j)
    if (robot.joint(j).type == JointType::kPrismatic) return true;
  return false;
}

}  // namespace

std::optional<cam::Dialect> maker_of(const std::string& folder) {
  std::error_code error;
  if (fs::exists(parameters_of(folder), error)) return cam::Dialect::kRapid;
  const std::set<std::string> files = names_in(folder);
  // A list says it for sure. Endings do not: FANUC's and Yaskawa's backups have `.dat` files, too.
  for (const cam::Dialect dialect : kWithLists) {
    const std::set<std::string> lists = cam::own_lists_of(dialect);
    if (std::any_of(files.begin(), files.end(),
                    [&](const std::string& file) { return lists.contains(file); }))
      return dialect;
  }
  for (const cam::Dialect dialect : kByPrograms) {
    if (std::any_of(files.begin(), files.end(),
                    [&](const std::string& file) { return cam::dialect_of_file(file) == dialect; }))
      return dialect;
  }
  return std::nullopt;
}

bool is_backup(const std::string& folder) {
  std::error_code error;
  if (fs::exists(parameters_of(folder), error)) return true;
  const std::set<std::string> files = names_in(folder);
  return std::any_of(std::begin(kWithLists), std::end(kWithLists), [&](cam::Dialect dialect) {
    const std::set<std::string> lists = cam::own_lists_of(dialect);
    return std::any_of(lists.begin(), lists.end(),
                       [&](const std::string& list) { return files.contains(list); });
  });
}

Result<cam::ControllerCell> read_controller(const BackupPlace& place) {
  const std::string moc = parameters_of(place.folder);
  const auto parameters = read_program_text(moc);
  const auto maker = parameters ? std::nullopt : maker_of(place.folder);
  if (maker && *maker != cam::Dialect::kRapid)
    return cam::read_own_lists(*maker, TRY(files_called(lists_of(*maker), place.folder)));
  if (!parameters) return tl::make_unexpected(parameters.error());
  return cam::read_backup(parameters->text, moc, TRY(modules_of(place)), place.unit);
}

std::string frames_csv(const cam::ControllerCell& controller) {
  std::string text = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz,may_be_unused\n";
  const auto add = [&](const std::string& name, const Pose& X) {
    const Vector3 p = X.translation() * to_mm(1);
    const Eigen::Quaterniond q(X.linear());
    text += csv_field(name);
    for (const double value : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()})
      text += "," + csv_number(value);
    text += ",yes\n";
  };
  add(cam::kRobotBase, controller.X_WB);
  for (const auto& [name, X_BO] : controller.frames) add(name, X_BO);
  return text;
}

Result<BackupRobot> robot_of_backup(const cam::ControllerCell& controller) {
  const std::string type = type_of(controller);
  const std::string factory =
      controller.compliances.empty() ? "" : "; compliances as its maker measured them";
  if (controller.arm)
    return BackupRobot{cam::with_compliances(*controller.arm, controller.compliances),
                       "lengths, senses, limits and speeds as its controller has them" + factory};
  for (const std::string& path : shipped_robots()) {
    const Result<Chain> robot = read_robot(path);
    if (!robot || type.empty() || has_rails(*robot) || !cam::is_type(type, robot->name())) continue;
    return BackupRobot{cam::with_compliances(*robot, controller.compliances),
                       fmt::format("{}, which is of the type that the controller names, {}{}",
                                   fs::path(path).filename().string(), shown(type), factory)};
  }
  if (type.empty())
    return refused("the files do not say which robot it is")
        .of("--robot")
        .next("--robot names its file; models/README.md says how one is written");
  return refused("the robot is a {}, no robot file of this type ships, and {}", shown(type),
                 controller.why_no_arm)
      .of("--robot")
      .with_text(type)
      .next("--robot names its file; models/README.md says how one is written");
}

}  // namespace trammel::cli
