#include "clients/cli/files/target_file.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "clients/cli/files/near_columns.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/exchange/si.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel::cli {

namespace {

constexpr double kPositionLimitMm = 1e6;
constexpr int kHighestConf = 7;
constexpr double kLargestMetres = 10;  // no arm reaches this far in m, and every arm reaches
                                       // farther in mm
constexpr double kNearestShareOfReach = 0.01;  // of the targets in the middle

/// m, of all its links; 0 for a gantry, whose links do not limit its reach.
double arm_length(const Chain& robot) {
  double length = 0;
  int rails = 0;
  for (int j = 0; j < robot.size(); ++j) {
    const LinkGeometry& link = robot.joint(j).link;
    length += std::hypot(link.a, link.d);
    if (robot.joint(j).type == JointType::kPrismatic) ++rails;
  }
  return rails > 1 ? 0 : length;
}

struct TargetColumns {
  PoseColumns commanded;
  std::vector<std::size_t> pose;  // x_mm ... qz; empty: joint targets
  std::optional<std::size_t> conf;
};

Result<TargetColumns> find_columns(const CsvTable& table) {
  PoseColumns commanded = TRY(PoseColumns::find(table));
  std::vector<std::size_t> pose =
      TRY(table.all_or_none({"x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"}));
  TargetColumns columns{std::move(commanded), std::move(pose), table.find("conf")};
  const bool joints = !columns.commanded.joint_types().empty();
  if (columns.pose.empty() && !joints) {
    return refused("neither a pose (x_mm,y_mm,z_mm,qw,qx,qy,qz) nor joints (q1_deg...)")
        .in(table.where())
        .of("x_mm")
        .next(fmt::format("the header has: {}", fmt::join(table.columns(), ",")));
  }
  if (!columns.conf && !joints) {
    return refused("missing column conf, or q1_deg... as the seed of the poses")
        .in(table.where())
        .of("conf");
  }
  return columns;
}

Result<exchange::Pose> read_pose(const CsvTable& table, std::size_t row,
                                 const std::vector<std::size_t>& columns) {
  std::array<double, 3> xyz_mm{};
  for (std::size_t k = 0; k < xyz_mm.size(); ++k)
    xyz_mm[k] = TRY(table.number(row, columns[k], kPositionLimitMm));
  return table.rotation(row, {columns.begin() + 3, columns.end()}).map([&](const Matrix3& R_BT) {
    return exchange::Pose{xyz_mm, exchange::from_si(make_pose(R_BT, Vector3::Zero())).q_wxyz};
  });
}

Status read_target(const CsvTable& table, std::size_t row, const TargetColumns& columns,
                   exchange::AskedTarget& target) {
  PoseContext comes = TRY(columns.commanded.circumstances(table, row));
  target.approach = {std::move(comes.direction), comes.temperature, comes.time};
  target.joint_target = columns.pose.empty();
  if (!columns.commanded.joint_types().empty() &&
      (target.joint_target || !columns.commanded.joints_empty(table, row))) {
    const JointVector seed = TRY(columns.commanded.joints(table, row));
    target.seed_rad =
        exchange::asked_from_si(seed, exchange::rails_of(columns.commanded.joint_types()));
  }
  if (target.joint_target) return {};
  target.pose = TRY(read_pose(table, row, columns.pose));
  if (columns.conf && !table.field(row, *columns.conf).empty()) {
    const int conf = TRY(table.integer(row, *columns.conf, 0, kHighestConf));
    target.conf = conf;
  }
  if (!target.conf && target.seed_rad.empty())
    return table.refuse(row, "neither conf nor joints as the seed of the pose").of("conf");
  return {};
}

/// A file that `correct` wrote: to correct it again would send the tool away by the correction once
/// more.
Status check_not_corrected(const CsvTable& table) {
  for (const char* column : {"status", "error_before_mm", "error_after_mm", "model_id"}) {
    if (!table.find(column)) return {};
  }
  const std::string model = table.size() == 0 ? "" : table.field(0, *table.find("model_id"));
  return refused("it is corrected already{}", model.empty() ? "" : ", by model " + model)
      .in(table.where())
      .of("model_id")
      .next("correct the file that it was made from");
}

}  // namespace

Result<TargetFile> parse_targets_csv(const std::string& text, const std::string& where) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  TRY(check_not_corrected(table));
  const TargetColumns columns = TRY(find_columns(table));
  if (table.size() == 0)
    return refused("no targets below the header, at least 1 is needed").in(where).beyond(0, 1);
  TargetFile file{where, columns.commanded.joint_types(), {}, table.columns()};
  for (std::size_t row = 0; row < table.size(); ++row) {
    TargetRow& target = file.rows.emplace_back();
    target.row = table.line(row);
    for (std::size_t k = 0; k < file.columns.size(); ++k)
      target.fields.push_back(table.field(row, k));
    TRY(read_target(table, row, columns, target.target));
  }
  return file;
}

Result<TargetFile> read_targets_csv(const std::string& path) {
  return read_text_file(path).and_then([&](const std::string& text) {
    Result<TargetFile> file = parse_targets_csv(text, path);
    if (file) tell_near_columns(text, TableKind::kTargets, path);
    return file;
  });
}

bool may_be_metres(const TargetFile& file) {
  return !file.rows.empty() &&
         std::all_of(file.rows.begin(), file.rows.end(), [](const TargetRow& row) {
           const auto& p = row.target.pose.xyz_mm;
           return !row.target.joint_target && std::all_of(p.begin(), p.end(), [](double mm) {
             return std::abs(mm) < kLargestMetres;
           });
         });
}

Error looks_like_metres(const TargetFile& file) {
  return refused(
             "the positions look like metres: x_mm, y_mm and z_mm are mm, and all are below {:g}",
             kLargestMetres)
      .in(file.where)
      .at_row(file.rows.front().row)
      .of("x_mm")
      .beyond(file.rows.front().target.pose.xyz_mm[0], kLargestMetres)
      .next("write them in mm, 1000 times as large")
      .value();
}

Status check_millimetres(const TargetFile& file, const Chain& robot) {
  if (!may_be_metres(file)) return {};
  std::vector<double> distances;
  for (const TargetRow& row : file.rows) {
    const auto& p = row.target.pose.xyz_mm;
    distances.push_back(from_mm(std::hypot(p[0], p[1], p[2])));
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  if (*middle >= kNearestShareOfReach * arm_length(robot)) return {};
  return tl::make_unexpected(looks_like_metres(file));
}

Status check_targets(const TargetFile& file, const Chain& robot) {
  if (!file.joint_types.empty()) {
    TRY(check_joint_columns(file.joint_types, robot, file.where));
  }
  for (const TargetRow& row : file.rows) {
    const auto directions = static_cast<int>(row.target.approach.directions.size());
    if (directions == 0 || directions == robot.size()) continue;
    return refused("{} direction columns, robot {} has {} joints", directions, robot.name(),
                   robot.size())
        .in(file.where)
        .of(fmt::format("dir{}", directions))
        .beyond(directions, robot.size());
  }
  TRY(check_millimetres(file, robot));
  if (has_spherical_wrist(robot)) return {};
  for (const TargetRow& row : file.rows) {
    if (!row.target.conf) continue;
    return refused("conf is {}, but robot {} has no spherical wrist to number branches by",
                   *row.target.conf, robot.name())
        .in(file.where)
        .at_row(row.row)
        .of("conf")
        .with_value(*row.target.conf)
        .next("give q1_deg...");
  }
  return {};
}

}  // namespace trammel::cli
