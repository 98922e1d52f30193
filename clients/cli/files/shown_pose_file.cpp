#include "clients/cli/files/shown_pose_file.h"

#include <algorithm>
#include <array>
#include <optional>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/files/text_lines.h"
#include "server/robot/three_numbers.h"

namespace trammel::cli {

namespace {

/// The columns of a table by their names without case, blanks and units.
class Columns {
 public:
  explicit Columns(const CsvTable& table) : table_(table) {
    for (const std::string& column : table.columns()) names_.push_back(column_name(column));
  }

  [[nodiscard]] std::optional<std::size_t> find(const std::string& name) const {
    for (std::size_t i = 0; i < names_.size(); ++i)
      if (names_[i].name == name) return i;
    return std::nullopt;
  }
  /// All of `names`, or none.
  template <std::size_t N>
  [[nodiscard]] std::optional<std::array<std::size_t, N>> all(
      const std::array<std::string, N>& names) const {
    std::array<std::size_t, N> columns = {};
    for (std::size_t i = 0; i < N; ++i) {
      const auto column = find(names[i]);
      if (!column) return std::nullopt;
      columns[i] = *column;
    }
    return columns;
  }
  [[nodiscard]] std::optional<std::size_t> joint(int number) const {
    for (const char* prefix : {"q", "j", "a", "joint"})
      if (const auto column = find(fmt::format("{}{}", prefix, number))) return column;
    return std::nullopt;
  }
  [[nodiscard]] const std::string& unit(std::size_t column) const { return names_[column].unit; }
  [[nodiscard]] const CsvTable& table() const { return table_; }

 private:
  const CsvTable& table_;
  std::vector<ColumnName> names_;
};

/// The numbers of a column, in m or rad by its unit, in `otherwise` (SI per unit) where it names
/// none.
Result<std::vector<double>> numbers(const Columns& columns, std::size_t column, double otherwise) {
  const std::string& unit = columns.unit(column);
  double scale = otherwise;
  if (unit == "deg") scale = from_deg(1);
  if (unit == "mm") scale = from_mm(1);
  if (unit == "rad" || unit == "m") scale = 1;
  std::vector<double> all;
  for (std::size_t row = 0; row < columns.table().size(); ++row) {
    const double value = TRY(columns.table().number(row, column));
    all.push_back(scale * value);
  }
  return all;
}

/// Three columns as one vector a row.
Result<std::vector<Vector3>> vectors(const Columns& columns,
                                     const std::array<std::size_t, 3>& three, double otherwise) {
  std::vector<Vector3> all(columns.table().size());
  for (std::size_t k = 0; k < 3; ++k) {
    const std::vector<double> values = TRY(numbers(columns, three[k], otherwise));
    for (std::size_t i = 0; i < all.size(); ++i) all[i](static_cast<Eigen::Index>(k)) = values[i];
  }
  return all;
}

Status read_joints(const Columns& columns, const Chain& robot, ShownPoses& shown) {
  shown.q.assign(columns.table().size(), JointVector::Zero(robot.size()));
  for (int j = 0; j < robot.size(); ++j) {
    const auto column = columns.joint(j + 1);
    if (!column)
      return refused("no column of joint {}; {} has {}", j + 1, robot.name(), robot.size())
          .in(columns.table().where())
          .of(fmt::format("q{}_deg", j + 1));
    const bool turns = robot.joint(j).type == JointType::kRevolute;
    const std::vector<double> values =
        TRY(numbers(columns, *column, turns ? from_deg(1) : from_mm(1)));
    for (std::size_t i = 0; i < values.size(); ++i) shown.q[i](j) = values[i];
  }
  if (columns.joint(robot.size() + 1)) {
    return refused("a column of joint {}, and {} has {}", robot.size() + 1, robot.name(),
                   robot.size())
        .in(columns.table().where())
        .of(columns.table().columns()[*columns.joint(robot.size() + 1)]);
  }
  return {};
}

Status read_quaternions(const Columns& columns, const std::array<std::size_t, 4>& wxyz,
                        ShownPoses& shown) {
  ShownPoses::Orientations read{"a quaternion", {}};
  for (std::size_t row = 0; row < columns.table().size(); ++row) {
    const Matrix3 R = TRY(columns.table().rotation(row, {wxyz.begin(), wxyz.end()}));
    read.R.push_back(R);
  }
  shown.orientations.push_back(std::move(read));
  return {};
}

Status read_angles(const Columns& columns, const std::array<std::size_t, 3>& three,
                   ShownPoses& shown) {
  const bool said = !columns.unit(three[0]).empty();
  for (const double unit : {from_deg(1), 1.0}) {
    if (said && unit == 1.0) break;
    const std::vector<Vector3> angles = TRY(vectors(columns, three, unit));
    for (const ThreeNumbers& way : ways_of_three_numbers()) {
      if (way.columns.empty()) continue;  // no controller shows this form
      ShownPoses::Orientations read{
          fmt::format("{} {} {}, {}", columns.table().columns()[three[0]],
                      columns.table().columns()[three[1]], columns.table().columns()[three[2]],
                      way.meaning.empty() ? way.name : way.meaning),
          {}};
      if (!said && unit == 1.0) read.meaning += ", rad";
      for (const Vector3& one : angles) read.R.push_back(way.rotation(one).toRotationMatrix());
      shown.orientations.push_back(std::move(read));
    }
  }
  return {};
}

Status read_orientations(const Columns& columns, ShownPoses& shown) {
  if (const auto wxyz = columns.all<4>({"qw", "qx", "qy", "qz"}))
    return read_quaternions(columns, *wxyz, shown);
  for (const ThreeNumbers& way : ways_of_three_numbers())
    for (const std::array<std::string, 3>& names : way.columns)
      if (const auto three = columns.all(names)) return read_angles(columns, *three, shown);
  return {};
}

}  // namespace

Result<ShownPoses> parse_shown_poses(const std::string& text, const std::string& where,
                                     const Chain& robot) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  const Columns columns(table);
  ShownPoses shown;
  TRY(read_joints(columns, robot, shown));
  const auto xyz = columns.all<3>({"x", "y", "z"});
  if (!xyz)
    return refused("no columns x_mm, y_mm, z_mm of the pose that the controller shows")
        .in(where)
        .of("x_mm");
  std::vector<Vector3> positions = TRY(vectors(columns, *xyz, from_mm(1)));
  shown.p = std::move(positions);
  TRY(read_orientations(columns, shown));
  return shown;
}

Result<ShownPoses> read_shown_poses(const std::string& path, const Chain& robot) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_shown_poses(text, path, robot); });
}

}  // namespace trammel::cli
