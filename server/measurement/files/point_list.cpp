#include "server/measurement/files/point_list.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>

#include "server/base/coverage.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_dialect.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/files/point_table.h"
#include "server/measurement/files/text_lines.h"

namespace trammel {

namespace {

constexpr double kPositionLimit = 1e3;   // m, beyond the range of any tracker
constexpr double kUncertaintyLimit = 1;  // m
constexpr double kAngleLimit = 360;      // deg
constexpr double kInch = 0.0254;         // m
constexpr std::size_t kLongestTime = 40;

/// `p1` of `Collection::Group::p1`, as SpatialAnalyzer writes the whole name of a point.
std::string last_component(const std::string& name) {
  const auto at = name.rfind("::");
  return at == std::string::npos ? name : name.substr(at + 2);
}

/// The Unix time of a moment as programs write it, taken for UTC; nothing if it is ambiguous.
std::optional<double> unix_time_of(const std::string& text) {
  if (is_number(text)) return std::stod(text);
  static const std::regex kYearFirst(
      R"((\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d):(\d\d(?:[.,]\d{1,9})?)Z?)");
  static const std::regex kDayFirst(
      R"((\d\d)\.(\d\d)\.(\d{4}) (\d\d):(\d\d):(\d\d(?:[.,]\d{1,9})?))");
  std::smatch part;
  const bool year_first = text.size() < kLongestTime && std::regex_match(text, part, kYearFirst);
  if (!year_first && !(text.size() < kLongestTime && std::regex_match(text, part, kDayFirst)))
    return std::nullopt;
  const auto number = [&](int k) { return std::stoi(part[static_cast<std::size_t>(k)].str()); };
  const std::chrono::year_month_day day{
      std::chrono::year(number(year_first ? 1 : 3)),
      std::chrono::month(static_cast<unsigned>(number(2))),
      std::chrono::day(static_cast<unsigned>(number(year_first ? 3 : 1)))};
  if (!day.ok() || number(4) > 23 || number(5) > 59) return std::nullopt;
  const double seconds = std::stod(with_decimal_point(part[6].str()));
  const auto midnight = std::chrono::sys_days(day).time_since_epoch();
  return static_cast<double>(std::chrono::seconds(midnight).count()) + 3600 * number(4) +
         60 * number(5) + seconds;
}

/// Reads rows of a table whose columns have our names.
class PointReader {
 public:
  PointReader(const PointTable& parts, double coverage)
      : table_(parts.table),
        positional_(parts.positional),
        coordinates_(*parts.statements.coordinates),
        length_(unit_length(parts.statements.unit.value_or(LengthUnit::kMillimetre))),
        angle_(parts.statements.radians.value_or(false) ? 1 : from_deg(1)),
        coverage_(coverage) {}

  [[nodiscard]] Status find_columns() {
    name_ = *table_.find("name");
    for (const std::string& column : coordinate_columns(coordinates_))
      position_.push_back(*table_.find(column));
    const CoordinateNames wanted = uncertainty_columns(coordinates_);
    auto uncertainties = TRY(table_.all_or_none({wanted.begin(), wanted.end()}));
    auto angles = TRY(table_.all_or_none({"rx", "ry", "rz"}));
    uncertainties_ = std::move(uncertainties);
    angles_ = std::move(angles);
    sigma_ = table_.find("sigma");
    return find_beside();
  }

  [[nodiscard]] const std::vector<std::string>& extra_columns() const { return extra_names_; }

  [[nodiscard]] Result<NamedPoint> read(std::size_t row) const {
    NamedPoint point;
    point.row = table_.line(row);
    std::string name = TRY(table_.name(row, name_));
    point.name = last_component(name);
    if (point.name.empty()) return table_.refuse(row, "name is empty").of("name");
    if (positional_ && is_number(point.name) && point.name.find('.') != std::string::npos) {
      return table_.refuse(row, "name is '{}', which looks like a coordinate", point.name)
          .of("name")
          .with_text(point.name)
          .next("expected [[collection] group] target first");
    }
    const Vector3 native = TRY(read_three(row, position_, coordinates_, kPositionLimit));
    if (coordinates_ != Coordinates::kCartesian && native.x() < 0) {
      return table_.refuse(row, "r is {:g}, must not be below 0", native.x() / length_)
          .of("r")
          .beyond(native.x() / length_, 0);
    }
    point.p_W = cartesian(native);
    TRY(read_rotation(row, point));
    TRY(read_sigma(row, native, point));
    TRY(read_u95(row, point));
    if (time_) point.time = unix_time_of(table_.field(row, *time_));
    for (const std::size_t column : extra_) point.extra.push_back(table_.field(row, column));
    if (time_) point.extra.push_back(point.time ? "" : table_.field(row, *time_));
    return point;
  }

 private:
  /// Finds the columns that the software of trackers writes beside coordinates.
  [[nodiscard]] Status find_beside() {
    auto quaternion = TRY(table_.all_or_none({"qw", "qx", "qy", "qz"}));
    auto axes = TRY(table_.all_or_none({kU95Axes.begin(), kU95Axes.end()}));
    quaternion_ = std::move(quaternion);
    u95_axes_ = std::move(axes);
    u95_ = table_.find(kU95);
    time_ = table_.find(kTimeStamp);
    constexpr std::array kNames = {"air_temperature_c", "air_pressure_hpa", "air_humidity_percent"};
    for (std::size_t k = 0; k < kWeather.size(); ++k) {
      const auto column = table_.find(kWeather[k]);
      if (!column) continue;
      extra_.push_back(*column);
      extra_names_.emplace_back(kNames[k]);
    }
    if (time_) extra_names_.emplace_back("time_stamp");
    return {};
  }

  [[nodiscard]] Result<double> expanded(std::size_t row, std::size_t column) const {
    const Result<double> u = table_.number(row, column, kUncertaintyLimit / length_);
    if (!u || *u >= 0) return u.map([&](double value) { return value * length_ / kExpanded; });
    return table_.refuse(row, "{} is {:g}, must not be below 0", table_.columns()[column], *u)
        .of(table_.columns()[column])
        .beyond(*u, 0);
  }

  /// Reads expanded uncertainties; sets none where they are 0 or not recorded.
  [[nodiscard]] Status read_u95(std::size_t row, NamedPoint& point) const {
    double square = 0;  // m², of the three axes together
    const std::vector<std::size_t> columns = !u95_axes_.empty() ? u95_axes_
                                             : u95_             ? std::vector<std::size_t>{*u95_}
                                                                : std::vector<std::size_t>();
    for (const std::size_t column : columns) {
      if (table_.field(row, column).empty()) return {};
      const double sigma = TRY(expanded(row, column));
      square += sigma * sigma;
    }
    if (square > 0) point.sigma = std::sqrt(square / 3);
    return {};
  }

  static double unit_length(LengthUnit unit) {
    return unit == LengthUnit::kMetre ? 1 : unit == LengthUnit::kInch ? kInch : from_mm(1);
  }

  /// Three numbers in m and rad; the coordinate system decides which of them are angles.
  [[nodiscard]] Result<Vector3> read_three(std::size_t row, const std::vector<std::size_t>& columns,
                                           Coordinates coordinates, double length_limit) const {
    Vector3 values;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool angle = (k == 1 && coordinates != Coordinates::kCartesian) ||
                         (k == 2 && coordinates == Coordinates::kSpherical);
      const double scale = angle ? angle_ : length_;
      const double value = TRY(
          table_.number(row, columns[k], (angle ? from_deg(kAngleLimit) : length_limit) / scale));
      values(static_cast<Eigen::Index>(k)) = value * scale;
    }
    return values;
  }

  [[nodiscard]] Vector3 cartesian(const Vector3& native) const {
    const double r = native.x();
    const double theta = native.y();
    if (coordinates_ == Coordinates::kCylindrical)
      return {r * std::cos(theta), r * std::sin(theta), native.z()};
    if (coordinates_ == Coordinates::kCartesian) return native;
    const double phi = native.z();
    return {r * std::sin(phi) * std::cos(theta), r * std::sin(phi) * std::sin(theta),
            r * std::cos(phi)};
  }

  [[nodiscard]] Status read_rotation(std::size_t row, NamedPoint& point) const {
    const bool turned =
        std::any_of(quaternion_.begin(), quaternion_.end(),
                    [&](std::size_t column) { return !table_.field(row, column).empty(); });
    if (turned) {
      const Eigen::Matrix3d R_W = TRY(table_.rotation(row, quaternion_));
      point.R_W = R_W;
      return {};
    }
    if (angles_.empty()) return {};
    Vector3 angles;
    for (std::size_t k = 0; k < 3; ++k) {
      const double value = TRY(table_.number(row, angles_[k], from_deg(kAngleLimit) / angle_));
      angles(static_cast<Eigen::Index>(k)) = value * angle_;
    }
    point.R_W = pose_zyx(Vector3::Zero(), angles.z(), angles.y(), angles.x()).linear();
    return {};
  }

  [[nodiscard]] Status read_sigma(std::size_t row, const Vector3& native, NamedPoint& point) const {
    if (sigma_ && !table_.field(row, *sigma_).empty()) {
      const double sigma = TRY(table_.number(row, *sigma_, kUncertaintyLimit / length_));
      if (sigma <= 0)
        return table_.refuse(row, "sigma is {:g}, must be above 0", sigma)
            .of("sigma")
            .beyond(sigma, 0);
      point.sigma = sigma * length_;
    }
    if (uncertainties_.empty()) return {};
    const Vector3 read = TRY(read_three(row, uncertainties_, coordinates_, kUncertaintyLimit));
    for (Eigen::Index k = 0; k < 3; ++k) {
      if ((read)(k) >= 0) continue;
      const std::size_t column = uncertainties_[static_cast<std::size_t>(k)];
      return table_
          .refuse(row, "{} is {}, must not be below 0", table_.columns()[column],
                  table_.field(row, column))
          .of(table_.columns()[column])
          .with_text(table_.field(row, column));
    }
    Vector3 along = read;  // m, along the three directions of the coordinates
    if (coordinates_ == Coordinates::kCylindrical) along.y() *= native.x();
    if (coordinates_ == Coordinates::kSpherical) {
      along.y() *= native.x() * std::abs(std::sin(native.z()));
      along.z() *= native.x();
    }
    if (along.norm() > 0) point.sigma = along.norm() / std::sqrt(3.0) / coverage_;
    return {};
  }

  const CsvTable& table_;
  bool positional_;
  Coordinates coordinates_;
  double length_;  // m in a unit of the file
  double angle_;   // rad in a unit of the file
  double coverage_;
  std::size_t name_ = 0;
  std::vector<std::size_t> position_, uncertainties_, angles_;
  std::optional<std::size_t> sigma_, u95_, time_;
  std::vector<std::size_t> quaternion_, u95_axes_, extra_;
  std::vector<std::string> extra_names_;
};

}  // namespace

Result<PointList> parse_points(const std::string& text, const std::string& where,
                               const PointFileOptions& options) {
  if (!(options.coverage > 0))
    return refused("coverage factor {:g}, must be above 0", options.coverage)
        .in(where)
        .of("coverage")
        .beyond(options.coverage, 0);
  const PointTable parts = TRY(take_apart(text, where, options));
  PointReader reader(parts, options.coverage);
  TRY(reader.find_columns());
  PointList list{where, {}, reader.extra_columns()};
  std::map<std::string, int> row_of_name;
  for (std::size_t row = 0; row < parts.table.size(); ++row) {
    NamedPoint point = TRY(reader.read(row));
    const auto [earlier, is_new] = row_of_name.emplace(point.name, point.row);
    if (!is_new) {
      return parts.table
          .refuse(row, "name '{}' is already that of row {}", point.name, earlier->second)
          .of("name")
          .with_text(point.name)
          .next(
              "names count without their collection and group: export one group, or rename the "
              "point");
    }
    list.points.push_back(std::move(point));
  }
  return list;
}

Result<PointList> read_points(const std::string& path, const PointFileOptions& options) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_points(text, path, options); });
}

namespace {

/// The point as the measurement of that pose.
Measurement measured_at(const CommandedPose& pose, const NamedPoint& point, int index) {
  Measurement measurement;
  measurement.pose_id = pose.pose_id;
  measurement.context = pose.context;
  measurement.context.index = index;
  if (point.time) measurement.context.time = point.time;
  measurement.p_W = point.p_W;
  measurement.R_WT = point.R_W;
  measurement.sigma = point.sigma;
  measurement.row = point.row;
  measurement.extra = point.extra;
  return measurement;
}

Status check_as_long(const PointList& points, const JointList& commanded) {
  const std::size_t n = points.points.size(), poses = commanded.poses.size();
  if (n == poses) return {};
  return refused(
             "{} points for the {} poses of {}: which belong together in their order is not known",
             n, poses, commanded.where)
      .in(points.where)
      .beyond(n, poses)
      .next("name the points as the poses, and join them by name");
}

}  // namespace

Result<MeasurementBatch> join_points(const PointList& points, const JointList& commanded,
                                     bool in_order) {
  if (points.points.empty())
    return refused("no points, at least 1 is needed").in(points.where).beyond(0, 1);
  TRY(in_order ? check_as_long(points, commanded) : Status());
  std::map<std::string, const CommandedPose*> pose_of_id;
  for (const CommandedPose& pose : commanded.poses) {
    const auto [earlier, is_new] = pose_of_id.emplace(last_component(pose.pose_id), &pose);
    if (is_new) continue;
    return refused("pose_id '{}' is already that of row {}", pose.pose_id, earlier->second->row)
        .in(commanded.where)
        .at_row(pose.row)
        .of("pose_id")
        .with_text(pose.pose_id);
  }
  MeasurementBatch batch;
  batch.id = std::filesystem::path(points.where).stem().string();
  batch.where = points.where;
  batch.joint_types = commanded.joint_types;
  batch.extra_columns = points.extra_columns;
  for (const NamedPoint& point : points.points) {
    const auto index = static_cast<int>(batch.measurements.size());
    if (in_order) {
      batch.measurements.push_back(
          measured_at(commanded.poses[batch.measurements.size()], point, index));
      continue;
    }
    const auto pose = pose_of_id.find(point.name);
    if (pose == pose_of_id.end()) {
      return refused("point '{}' has no pose of that pose_id in {}", point.name, commanded.where)
          .in(points.where)
          .at_row(point.row)
          .of("name")
          .with_text(point.name)
          .next("measure under the names of the plan, or name the plan that was measured");
    }
    batch.measurements.push_back(measured_at(*pose->second, point, index));
  }
  batch.source_text = to_csv(batch);
  return batch;
}

}  // namespace trammel
