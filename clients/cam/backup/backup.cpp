#include "clients/cam/backup/backup.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "clients/cam/backup/parameters.h"
#include "clients/cam/cell_tools.h"
#include "clients/cam/number_text.h"
#include "clients/cam/rapid/rapid.h"
#include "clients/cam/stated_robot.h"
#include "server/base/name_check.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

constexpr std::size_t kAxes = 6;
constexpr double kSameMm = 0.01, kSameDeg = 0.005;  // of tools, base and frames
constexpr double kSameMassKg = 0.05, kSameCentreMm = 1;
constexpr double kSameLimitDeg = 0.05;

const ParameterInstance* named(const std::vector<ParameterInstance>& all, const std::string& type,
                               const std::string& name) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const ParameterInstance& one) {
    return one.type == type && one.text("name") == name;
  });
  return found == all.end() ? nullptr : &*found;
}

std::string yaml_pose(const Pose& X) {
  const Vector3 p = X.translation() * to_mm(1);
  Eigen::Quaterniond q(X.linear());
  if (q.w() < 0) q.coeffs() *= -1;
  return fmt::format(
      "{{xyz_mm: [{:.6g}, {:.6g}, {:.6g}], q_wxyz: [{:.9g}, {:.9g}, {:.9g}, {:.9g}]}}", p.x() + 0.0,
      p.y() + 0.0, p.z() + 0.0, q.w() + 0.0, q.x() + 0.0, q.y() + 0.0, q.z() + 0.0);
}

std::string yaml_load(const StatedLoad& load) {
  const Vector3 p = load.p_F * to_mm(1);
  return fmt::format("{{mass_kg: {:.6g}, cog_mm: [{:.6g}, {:.6g}, {:.6g}]}}", load.mass,
                     p.x() + 0.0, p.y() + 0.0, p.z() + 0.0);
}

class Backup {
 public:
  Backup(const std::string& parameters, const std::string& where)
      : where_(where),
        is_text_(check_texts({{where, parameters}})),
        instances_(parameter_instances(parameters)) {}

  Result<ControllerRobot> robot(const std::string& unit, const std::string& next) {
    if (!is_text_) return tl::make_unexpected(is_text_.error());
    const ParameterInstance* robot = TRY(choose(unit, next));
    cell_.unit = robot->text("name");
    cell_.robot_type = robot->text("use_robot_type");
    cell_.file = where_;
    cell_.line = robot->line;
    cell_.axes = axes_of(*robot);
    find_couplings(*robot);
    for (const Status& read : {read_base(*robot), read_limits(*robot)}) {
      if (!read) return tl::make_unexpected(read.error());
    }
    read_calibration(*robot);
    if (const Status read = read_factory(*robot); !read) return tl::make_unexpected(read.error());
    return cell_;
  }

  Result<ControllerCell> read(const std::vector<SourceFile>& modules, const std::string& unit) {
    TRY(robot(unit, "--unit says which"));
    TRY(read_modules(modules));
    return std::move(cell_);
  }

 private:
  Result<const ParameterInstance*> choose(const std::string& unit, const std::string& next) const {
    std::vector<const ParameterInstance*> robots;
    std::vector<std::string> names;
    for (const ParameterInstance& one : instances_) {
      if (one.type != "ROBOT") continue;
      names.push_back(one.text("name"));
      if (unit.empty() || unit == one.text("name")) robots.push_back(&one);
    }
    if (names.empty()) return refused("no robot in these system parameters").in(where_).of("ROBOT");
    if (robots.size() == 1) return robots[0];
    return refused("{} robots: {}", names.size(), shown(fmt::format("{}", fmt::join(names, ", "))))
        .in(where_)
        .of("ROBOT")
        .with_text(unit)
        .next(next);
  }

  /// The number of axes by `use_joint_0`, ...: a SCARA has four. No robot has fewer than three, so
  /// with fewer the number is unknown.
  static int axes_of(const ParameterInstance& robot) {
    constexpr int kFewest = 3;
    int named = 0;
    for (std::size_t k = 0; k < kAxes; ++k)
      named += robot.text(fmt::format("use_joint_{}", k)).empty() ? 0 : 1;
    return named >= kFewest ? named : 0;
  }

  /// The parameters of an axis: its JOINT, and its ARM, which has the bounds.
  [[nodiscard]] std::vector<const ParameterInstance*> parameters_of(const ParameterInstance& robot,
                                                                    std::size_t axis) const {
    const std::string name = robot.text(fmt::format("use_joint_{}", axis));
    if (name.empty()) return {};
    const ParameterInstance* joint = named(instances_, "JOINT", name);
    const std::string used = joint != nullptr ? joint->text("use_arm") : "";
    std::vector<const ParameterInstance*> found = {
        named(instances_, "ARM", used.empty() ? name : used), joint};
    found.erase(std::remove(found.begin(), found.end(), nullptr), found.end());
    return found;
  }

  /// `-coupled_upper_joint_bound 1.2`: bounds that depend on another axis are those of a parallel
  /// arm.
  void find_couplings(const ParameterInstance& robot) {
    static const std::set<std::string> kNot = {"",    "0",   "no",    "No",    "NO",   "off",
                                               "Off", "OFF", "false", "False", "FALSE"};
    for (std::size_t k = 0; k < kAxes; ++k) {
      for (const ParameterInstance* of : parameters_of(robot, k)) {
        for (const auto& [name, value] : of->values) {
          const bool coupled =
              name.find("coupl") != std::string::npos || name.find("parallel") != std::string::npos;
          if (coupled && !kNot.contains(value))
            cell_.couplings.push_back({static_cast<int>(k), name, value, where_, of->line});
        }
      }
    }
  }

  /// The number in an attribute; `otherwise` is the controller's default for a missing one.
  Status number(const ParameterInstance& of, const std::string& attribute, double otherwise,
                double& value) const {
    value = otherwise;
    const auto found = of.values.find(attribute);
    if (found == of.values.end()) return {};
    const auto written = read_number(found->second);
    if (!written) {
      return refused("-{} {} of {}: expected a number", attribute, shown_short(found->second),
                     of.type)
          .in(where_)
          .at_row(of.line)
          .of(attribute)
          .with_text(found->second);
    }
    value = written->value;
    return {};
  }

  Status read_base(const ParameterInstance& robot) {
    static constexpr std::array<const char*, 7> kParts = {
        "pos_x", "pos_y", "pos_z", "orient_u0", "orient_u1", "orient_u2", "orient_u3"};
    std::array<double, 7> v{};
    for (std::size_t k = 0; k < kParts.size(); ++k) {
      TRY(number(robot, fmt::format("base_frame_{}", kParts[k]), k == 3 ? 1 : 0, v[k]));
    }
    const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
    if (std::abs(q.norm() - 1) > 1e-2) {
      return refused("base frame: a quaternion of length {:.4f}", q.norm())
          .in(where_)
          .at_row(robot.line)
          .of("base_frame_orient_u0")
          .beyond(q.norm(), 1);
    }
    cell_.X_WB = make_pose(q.normalized().toRotationMatrix(), {v[0], v[1], v[2]});
    cell_.carried_by = robot.text("base_frame_coordinated");
    if (!cell_.carried_by.empty())
      cell_.notes.push_back(
          fmt::format("{} carries the robot: its base frame moves", shown(cell_.carried_by)));
    return {};
  }

  Status read_limits(const ParameterInstance& robot) {
    for (std::size_t k = 0; k < kAxes; ++k) {
      const std::vector<const ParameterInstance*> all = parameters_of(robot, k);
      const ParameterInstance* arm = all.empty() || all[0]->type != "ARM" ? nullptr : all[0];
      if (arm == nullptr || !arm->values.contains("upper_joint_bound") ||
          !arm->values.contains("lower_joint_bound")) {
        cell_.notes.push_back(fmt::format(
            "the bounds of axis {} are not in the parameters: no ranges are taken", k + 1));
        cell_.limits.clear();
        return {};
      }
      double lower = 0, upper = 0;
      TRY(number(*arm, "lower_joint_bound", 0, lower));
      TRY(number(*arm, "upper_joint_bound", 0, upper));
      if (!(lower < upper)) {
        return refused("axis {}: bounds {:g} and {:g} rad", k + 1, lower, upper)
            .in(where_)
            .at_row(arm->line)
            .of("lower_joint_bound")
            .beyond(lower, upper);
      }
      cell_.limits.emplace_back(lower, upper);
    }
    return {};
  }

  /// Absolute Accuracy is in use where the robot refers to its calibration, `r1_calib`, not to
  /// `r1_uncalib`.
  void read_calibration(const ParameterInstance& robot) {
    const std::string used = robot.text("use_robot_calib");
    if (used.empty())
      cell_.notes.push_back(
          "the parameters do not name a calibration (use_robot_calib): it is taken as not in use");
    cell_.controller_compensates =
        used.find("calib") != std::string::npos && used.find("uncalib") == std::string::npos;
  }

  /// What the maker measured at this arm. An attribute that is not there is 0.
  Status read_factory(const ParameterInstance& robot) {
    std::vector<double> compliances;
    for (std::size_t k = 0; k < kAxes; ++k) {
      const std::string name = robot.text(fmt::format("use_joint_{}", k));
      const int axis = static_cast<int>(k) + 1;
      if (const ParameterInstance* arm = named(instances_, "ARM_CALIB", name))
        TRY(add_factory("arm", axis, *arm));
      const ParameterInstance* joint = named(instances_, "JOINT_CALIB", name);
      double compliance = 0;
      if (joint != nullptr) {
        TRY(add_factory("joint", axis, *joint));
        TRY(number(*joint, "Compl", 0, compliance));
      }
      compliances.push_back(compliance);
    }
    if (std::any_of(compliances.begin(), compliances.end(), [](double c) { return c > 0; }))
      cell_.compliances = std::move(compliances);
    const auto untaken = std::count_if(cell_.factory.begin(), cell_.factory.end(),
                                       [](const FactoryValue& one) { return one.part == "arm"; });
    if (untaken > 0)
      cell_.notes.push_back(fmt::format(
          "the maker measured this arm: {} values of ARM_CALIB are shown by --json and not taken, "
          "since the maker does not say in which frames they hold",
          untaken));
    return {};
  }

  Status add_factory(const char* part, int axis, const ParameterInstance& of) {
    for (const auto& [name, text] : of.values) {
      const bool length = name.starts_with("error_offset"),
                 angle = name == "error_roll" || name == "error_pitch" || name == "error_jaw";
      if (!length && !angle && name != "Compl" && !name.starts_with("arm_compliance")) continue;
      double value = 0;
      TRY(number(of, name, 0, value));
      if (value != 0)
        cell_.factory.push_back({part, axis, name, value, length ? "m" : angle ? "rad" : "rad/Nm"});
    }
    return {};
  }

  static Status check_texts(std::vector<SourceFile> files) {
    Program program;
    program.files = std::move(files);
    return check_files(program);
  }

  Status read_modules(const std::vector<SourceFile>& modules) {
    TRY(check_texts(modules));
    const RapidData data = read_rapid_data(modules);
    const Pose X_BW = cell_.X_WB.inverse();
    for (const ProgramTool& tool : data.tools) {
      TRY(take(tool));
    }
    take_frames(data);
    take_loads(data);
    for (auto& [name, X_WO] : cell_.frames) X_WO = X_BW * X_WO;
    return {};
  }

  void take_frames(const RapidData& data) {
    std::map<std::string, std::string> where;
    std::set<std::string> doubtful;
    for (const RapidData::Frame& one : data.frames) {
      const ProgramFrame& frame = one.frame;
      if (!frame.why_not.empty()) {
        cell_.notes.push_back(frame.why_not);
        continue;
      }
      const auto [known, fresh] = cell_.frames.emplace(frame.name, frame.X_BO);
      if (fresh) where[frame.name] = one.where;
      if (known->second.isApprox(frame.X_BO, 1e-9)) continue;
      cell_.notes.push_back("left out: " + two_values("work object", frame.name,
                                                      pose_text(known->second), where[frame.name],
                                                      pose_text(frame.X_BO), one.where));
      doubtful.insert(frame.name);
    }
    for (const std::string& name : doubtful) cell_.frames.erase(name);
  }

  void take_loads(const RapidData& data) {
    std::map<std::string, std::string> where;
    std::set<std::string> doubtful;
    for (const RapidData::Load& one : data.loads) {
      if (!check_name(one.name, "payload")) continue;
      const auto [known, fresh] = cell_.loads.emplace(one.name, one.load);
      if (fresh) where[one.name] = one.where;
      if (known->second.mass == one.load.mass && known->second.p_F == one.load.p_F) continue;
      cell_.notes.push_back("left out: " + two_values("load", one.name, yaml_load(known->second),
                                                      where[one.name], yaml_load(one.load),
                                                      one.where));
      doubtful.insert(one.name);
    }
    for (const std::string& name : doubtful) cell_.loads.erase(name);
  }

  Status take(const ProgramTool& tool) {
    if (!tool.why_not.empty() || !tool.X_FT) {
      cell_.notes.push_back(tool.why_not);
      return {};
    }
    if (const Status fine = check_name(tool.name, "tool"); !fine) {
      cell_.notes.push_back(sentence(fine.error()));
      return {};
    }
    StatedTool stated{*tool.X_FT, tool.load, fmt::format("{} line {}", tool.file, tool.line)};
    if (stated.load && is_placeholder(*stated.load)) stated.load.reset();
    const auto [known, fresh] = cell_.tools.emplace(tool.name, stated);
    if (known->second.X_FT.isApprox(stated.X_FT, 1e-9)) return {};
    return refused("{}", two_values("tool", tool.name, pose_text(known->second.X_FT),
                                    known->second.where, pose_text(stated.X_FT), stated.where))
        .of("tooldata")
        .with_text(tool.name);
  }

  static std::string two_values(const char* what, const std::string& name, const std::string& one,
                                const std::string& at_one, const std::string& other,
                                const std::string& at_other) {
    return fmt::format("{} {} has two values in the modules, {} ({}) and {} ({})", what,
                       shown(name), one, shown(at_one), other, shown(at_other));
  }

  const std::string where_;
  const Status is_text_;
  const std::vector<ParameterInstance> instances_;
  ControllerCell cell_;
};

bool same(const Pose& a, const Pose& b) {
  return to_mm((a.translation() - b.translation()).norm()) <= kSameMm &&
         to_deg(pose_difference(a, b).tail<3>().norm()) <= kSameDeg;
}

void compare_tools(const ControllerCell& controller, const Cell& cell,
                   std::vector<std::string>& found) {
  for (const auto& [name, tool] : controller.tools) {
    const auto known = cell.tools.find(name);
    if (known == cell.tools.end()) {
      found.push_back(
          fmt::format("tool {} ({}) is not in the cell", shown(name), shown(tool.where)));
    } else if (known->second && !same(tool.X_FT, *known->second)) {
      found.push_back(fmt::format("tool {} is {} in the controller, {} in the cell: {}",
                                  shown(name), yaml_pose(tool.X_FT), yaml_pose(*known->second),
                                  apart_text(tool.X_FT, *known->second)));
    }
  }
  for (const auto& [name, X_FT] : cell.tools) {
    if (!controller.tools.contains(name))
      found.push_back(fmt::format("tool {} of the cell is not in the controller", name));
  }
}

void compare_loads(const ControllerCell& controller, const Cell& cell,
                   std::vector<std::string>& found) {
  for (const auto& [name, tool] : controller.tools) {
    const auto known = cell.payloads.find(name);
    if (!tool.load || known == cell.payloads.end()) continue;
    const double mass = std::abs(tool.load->mass - known->second.mass);
    const double centre = to_mm((tool.load->p_F - known->second.p_FoCog_F).norm());
    if (mass <= kSameMassKg && centre <= kSameCentreMm) continue;
    found.push_back(fmt::format(
        "load of tool {} is {} in the controller, {} in the cell: {:.3f} kg and {:.1f} mm apart",
        shown(name), yaml_load(*tool.load),
        yaml_load({known->second.mass, known->second.p_FoCog_F}), mass, centre));
  }
}

void compare_limits(const ControllerCell& controller, const Cell& cell,
                    std::vector<std::string>& found) {
  std::vector<int> turning;
  for (int j = 0; j < cell.robot.size(); ++j) {
    if (cell.robot.joint(j).type == JointType::kRevolute) turning.push_back(j);
  }
  if (controller.limits.size() != turning.size()) return;
  for (std::size_t k = 0; k < turning.size(); ++k) {
    const auto& [lower, upper] = controller.limits[k];
    const Joint& joint = cell.robot.joint(turning[k]);
    // The cell may plan for less than the controller allows, never for more.
    const double low = cell.joint_ranges.empty()
                           ? joint.lower
                           : cell.joint_ranges[static_cast<std::size_t>(turning[k])].first;
    const double high = cell.joint_ranges.empty()
                            ? joint.upper
                            : cell.joint_ranges[static_cast<std::size_t>(turning[k])].second;
    if (to_deg(lower - low) <= kSameLimitDeg && to_deg(high - upper) <= kSameLimitDeg) continue;
    found.push_back(
        fmt::format("axis {} may go from {:.2f} to {:.2f} deg in the controller, from {:.2f} to "
                    "{:.2f} in the cell",
                    k + 1, to_deg(lower), to_deg(upper), to_deg(low), to_deg(high)));
  }
}

}  // namespace

Result<ControllerRobot> read_controller_robot(const std::string& parameters,
                                              const std::string& where, const std::string& unit,
                                              const std::string& next) {
  return Backup(parameters, where).robot(unit, next);
}

std::string unit_of_task(const std::string& parameters, const std::string& task) {
  const auto number_of = [](const std::string& name) {
    const std::size_t last = name.find_last_not_of("0123456789");
    return last == std::string::npos ? name : name.substr(last + 1);
  };
  std::vector<std::string> robots;
  for (const ParameterInstance& one : parameter_instances(parameters)) {
    if (one.type == "ROBOT") robots.push_back(one.text("name"));
  }
  if (robots.size() < 2 || number_of(task).empty()) return "";
  const auto same = std::find_if(robots.begin(), robots.end(), [&](const std::string& robot) {
    return number_of(robot) == number_of(task);
  });
  return same == robots.end() ? "" : *same;
}

Chain with_compliances(const Chain& arm, const std::vector<double>& compliances) {
  std::vector<Joint> joints;
  std::size_t turning = 0;
  for (int j = 0; j < arm.size(); ++j) {
    joints.push_back(arm.joint(j));
    const bool turns = joints.back().type == JointType::kRevolute;
    if (turns && turning < compliances.size())
      joints.back().compliance_prior = compliances[turning++];
  }
  return Chain::make(arm.name(), std::move(joints), arm.couplings()).value_or(arm);
}

StatedRobot stated_by(const ControllerRobot& robot) {
  if (!robot.stated.numbers.empty() || !robot.stated.types.empty()) return robot.stated;
  StatedRobot stated;
  if (robot.carried_by.empty())
    stated.bases.push_back({robot.X_WB, "base_frame", robot.file, robot.line});
  if (robot.axes > 0)
    stated.numbers.push_back(
        {ArmNumber::kAxes, static_cast<double>(robot.axes), "use_joint", robot.file, robot.line});
  if (!robot.robot_type.empty())
    stated.types.push_back({robot.robot_type, "use_robot_type", robot.file, robot.line});
  stated.couplings = robot.couplings;
  return stated;
}

Status check_robot(const ControllerRobot& controller, const Chain& robot) {
  Program program;
  take_stated(stated_by(controller), program);
  return check_stated_robot(program, robot);
}

Result<ControllerCell> read_backup(const std::string& parameters, const std::string& where,
                                   const std::vector<SourceFile>& modules,
                                   const std::string& unit) {
  return Backup(parameters, where).read(modules, unit);
}

std::string cell_file_of(const ControllerCell& controller, const CellFileOptions& options) {
  std::string text = fmt::format(
      "# From the backup of a controller ({}): {}, {}.\nversion: 1\ncell: {}\nrobot: {}\n",
      controller.maker, shown(controller.unit), shown(controller.robot_type), options.name,
      options.robot);
  text += options.base_from_data
              ? fmt::format("base: null   # found from the data; in the controller's world: {}\n",
                            yaml_pose(controller.X_WB))
              : fmt::format(
                    "base: {}   # in the controller's world; of the tracker's: null finds "
                    "it from the data\n",
                    yaml_pose(controller.X_WB));
  text += "tools:\n";
  for (const auto& [tool, stated] : controller.tools)
    text += fmt::format("  {}: {}\n", tool, yaml_pose(stated.X_FT));
  std::string payloads;
  for (const auto& [tool, stated] : controller.tools) {
    if (stated.load) payloads += fmt::format("  {}: {}\n", tool, yaml_load(*stated.load));
  }
  for (const auto& [load, stated] : controller.loads) {
    if (!controller.tools.contains(load))
      payloads += fmt::format("  {}: {}\n", load, yaml_load(stated));
  }
  if (!payloads.empty()) text += "payloads:\n" + payloads;
  if (!controller.limits.empty()) {
    std::vector<std::string> ranges;
    for (std::size_t k = 0; k < controller.limits.size(); ++k)
      ranges.push_back(fmt::format("q{}: [{:.6g}, {:.6g}]", k + 1,
                                   to_deg(controller.limits[k].first),
                                   to_deg(controller.limits[k].second)));
    text += fmt::format("joint_ranges_deg: {{{}}}\n", fmt::join(ranges, ", "));
  }
  if (options.workspace) {
    const Vector3 a = options.workspace->lower * to_mm(1), b = options.workspace->upper * to_mm(1);
    text += fmt::format(
        "workspace_mm: {{lower: [{:.6g}, {:.6g}, {:.6g}], upper: [{:.6g}, {:.6g}, {:.6g}]}}\n",
        a.x(), a.y(), a.z(), b.x(), b.y(), b.z());
  }
  return text + fmt::format("controller_compensates: {}\n", controller.controller_compensates);
}

std::vector<std::string> differences(const ControllerCell& controller, const Cell& cell,
                                     bool cell_compensates) {
  std::vector<std::string> found;
  if (cell.X_WB && !same(controller.X_WB, *cell.X_WB)) {
    found.push_back(fmt::format("the base is {} in the controller, {} in the cell: {}",
                                yaml_pose(controller.X_WB), yaml_pose(*cell.X_WB),
                                apart_text(controller.X_WB, *cell.X_WB)));
  }
  compare_tools(controller, cell, found);
  compare_loads(controller, cell, found);
  compare_limits(controller, cell, found);
  if (controller.controller_compensates != cell_compensates) {
    found.push_back(fmt::format(
        "the controller's own calibration is {} use, the cell says controller_compensates: {}",
        controller.controller_compensates ? "in" : "not in", cell_compensates));
  }
  return found;
}

}  // namespace trammel::cam
