#include "clients/cli/files/target_file.h"

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel::cli {

namespace {

constexpr double kPositionLimitMm = 1e6;
constexpr int kHighestConf = 7;

struct TargetColumns {
  PoseColumns commanded;
  std::vector<std::size_t> pose;  // x_mm ... qz; empty: joint targets
  std::optional<std::size_t> conf;
};

Result<TargetColumns> find_columns(const CsvTable& table) {
  Result<PoseColumns> commanded = PoseColumns::find(table);
  if (!commanded) return tl::make_unexpected(commanded.error());
  Result<std::vector<std::size_t>> pose = table.all_or_none({"x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"});
  if (!pose) return tl::make_unexpected(pose.error());
  TargetColumns columns{std::move(*commanded), std::move(*pose), table.find("conf")};
  const bool joints = !columns.commanded.joint_types().empty();
  if (columns.pose.empty() && !joints) {
    return refused("neither a pose (x_mm,y_mm,z_mm,qw,qx,qy,qz) nor joints (q1_deg...)")
        .in(table.where())
        .of("x_mm")
        .next(fmt::format("the header has: {}", fmt::join(table.columns(), ",")));
  }
  if (!columns.conf && !joints) {
    return refused("missing column conf, or q1_deg... as the seed of the poses").in(table.where()).of("conf");
  }
  return columns;
}

Result<Pose> read_pose(const CsvTable& table, std::size_t row, const std::vector<std::size_t>& columns) {
  Pose X_BT = Pose::Identity();
  for (std::size_t k = 0; k < 3; ++k) {
    const Result<double> value = table.number(row, columns[k], kPositionLimitMm);
    if (!value) return tl::make_unexpected(value.error());
    X_BT.translation()(static_cast<Eigen::Index>(k)) = from_mm(*value);
  }
  return table.rotation(row, {columns.begin() + 3, columns.end()}).map([&](const Matrix3& R_BT) {
    X_BT.linear() = R_BT;
    return X_BT;
  });
}

Status read_target(const CsvTable& table, std::size_t row, const TargetColumns& columns, Target& target) {
  Result<PoseContext> comes = columns.commanded.circumstances(table, row);
  if (!comes) return tl::make_unexpected(comes.error());
  target.direction = std::move(comes->direction);
  target.temperature = comes->temperature;
  target.time = comes->time;
  target.joint_target = columns.pose.empty();
  if (!columns.commanded.joint_types().empty() &&
      (target.joint_target || !columns.commanded.joints_empty(table, row))) {
    Result<JointVector> seed = columns.commanded.joints(table, row);
    if (!seed) return tl::make_unexpected(seed.error());
    target.seed = std::move(*seed);
  }
  if (target.joint_target) return {};
  const Result<Pose> X_BT = read_pose(table, row, columns.pose);
  if (!X_BT) return tl::make_unexpected(X_BT.error());
  target.X_BT = *X_BT;
  if (columns.conf && !table.field(row, *columns.conf).empty()) {
    const Result<int> conf = table.integer(row, *columns.conf, 0, kHighestConf);
    if (!conf) return tl::make_unexpected(conf.error());
    target.conf = *conf;
  }
  if (!target.conf && !target.seed)
    return table.refuse(row, "neither conf nor joints as the seed of the pose").of("conf");
  return {};
}

/// A file that `correct` wrote: to correct it again would send the tool away by the correction once more.
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
  const Result<CsvTable> table = CsvTable::parse(text, where);
  if (!table) return tl::make_unexpected(table.error());
  if (const Status fresh = check_not_corrected(*table); !fresh) return tl::make_unexpected(fresh.error());
  const Result<TargetColumns> columns = find_columns(*table);
  if (!columns) return tl::make_unexpected(columns.error());
  if (table->size() == 0) return refused("no targets below the header, at least 1 is needed").in(where).beyond(0, 1);
  TargetFile file{where, columns->commanded.joint_types(), {}, table->columns()};
  for (std::size_t row = 0; row < table->size(); ++row) {
    TargetRow& target = file.rows.emplace_back();
    target.row = table->line(row);
    for (std::size_t k = 0; k < file.columns.size(); ++k) target.fields.push_back(table->field(row, k));
    if (const Status read = read_target(*table, row, *columns, target.target); !read) {
      return tl::make_unexpected(read.error());
    }
  }
  return file;
}

Result<TargetFile> read_targets_csv(const std::string& path) {
  return read_text_file(path).and_then([&](const std::string& text) { return parse_targets_csv(text, path); });
}

Status check_targets(const TargetFile& file, const Chain& robot) {
  if (!file.joint_types.empty()) {
    if (const Status joints = check_joint_columns(file.joint_types, robot, file.where); !joints) return joints;
  }
  for (const TargetRow& row : file.rows) {
    const auto directions = static_cast<int>(row.target.direction.size());
    if (directions == 0 || directions == robot.size()) continue;
    return refused("{} direction columns, robot {} has {} joints", directions, robot.name(), robot.size())
        .in(file.where)
        .of(fmt::format("dir{}", directions))
        .beyond(directions, robot.size());
  }
  if (has_spherical_wrist(robot)) return {};
  for (const TargetRow& row : file.rows) {
    if (!row.target.conf) continue;
    return refused("conf is {}, but robot {} has no spherical wrist to number branches by", *row.target.conf,
                   robot.name())
        .in(file.where)
        .at_row(row.row)
        .of("conf")
        .with_value(*row.target.conf)
        .next("give q1_deg...");
  }
  return {};
}

}  // namespace trammel::cli
