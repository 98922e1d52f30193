#include "server/compensate/what_was_measured.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "server/base/units.h"
#include "server/measurement/one_place.h"
#include "server/measurement/pose_groups.h"
#include "server/robot/cell_papers.h"

namespace trammel {

namespace {

constexpr double kNeighbour =
    0.95;  // of the poses have their neighbour within the distance that counts
constexpr double kBeyond =
    1.5;  // times it: fresh poses lie between the measured ones, and a little outside
constexpr double kFew = 4;            // among n poses the distance is known to 1 + 4/n
constexpr double kLeastReach = 0.05;  // of the region's diagonal, if poses form clusters
constexpr Eigen::Index kFewestOfTail = 12, kLeastTail = 2,
                       kMostTail = 6;  // places; of a tail the outermost ones
constexpr double kTailScales =
    7;  // 1 of 1000 places is farther out; with many places the reach limits this earlier
constexpr double kUsualMargin = 0.05;  // of a joint's range
constexpr double kMarginOfFew =
    45;  // over n² places, in addition: a Latin hypercube of n places leaves this at its edges
constexpr double kMostMargin = 0.1;
constexpr double kRounding = 1e-6;  // m
constexpr Eigen::Index kPlaces =
    2000;  // at most, evenly among the poses, since each prediction looks at all of them
constexpr int kCells = 24;          // of the box along each axis
constexpr double kBothSides = 0.1;  // of the poses with a recorded side must come from the rarer
                                    // side, otherwise the joint has one side
constexpr const char* kNotOnRecord = "not on record";

double nearest(const Eigen::Matrix3Xd& places, const Vector3& place) {
  return std::sqrt((places.colwise() - place).colwise().squaredNorm().minCoeff());
}

/// From each place to the nearest of the others, rising.
std::vector<double> distances_to_neighbours(Eigen::Matrix3Xd places) {
  std::vector<double> distances;
  for (Eigen::Index i = 0; i < places.cols(); ++i) {
    const Vector3 own = places.col(i);
    places.col(i).setConstant(std::numeric_limits<double>::infinity());
    distances.push_back(nearest(places, own));
    places.col(i) = own;
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

/// 16 x N, m: how far each place is in each direction of the outline.
Eigen::MatrixXd along_outline(const Eigen::Matrix3Xd& places) {
  constexpr int kCount = WhatWasMeasured::kDirections;
  const Eigen::ArrayXd angle =
      Eigen::ArrayXd::LinSpaced(kCount + 1, 0, 2 * std::numbers::pi).head(kCount);
  Eigen::MatrixX2d directions(kCount, 2);
  directions << angle.cos().matrix(), angle.sin().matrix();
  return directions * places.topRows<2>();
}

/// 16, m: for each direction of the outline, the distance that other poses of the same kind may go
/// beyond the outermost place. It depends on the spacing of the last places there: a factor times
/// the mean by which they exceed the next one (the scale of an exponential tail). It applies only
/// where the direction leads away from the base's axis: behind the axis is another region, however
/// few places are in front.
Eigen::VectorXd beyond_outermost(const Eigen::MatrixXd& along) {
  const Eigen::VectorXd outermost = along.rowwise().maxCoeff();
  const double farthest = outermost.maxCoeff();
  Eigen::VectorXd beyond = Eigen::VectorXd::Zero(along.rows());
  if (along.cols() < kFewestOfTail || farthest <= 0) return beyond;
  const Eigen::Index last = std::clamp<Eigen::Index>(along.cols() / 5, kLeastTail, kMostTail);
  for (Eigen::Index d = 0; d < along.rows(); ++d) {
    std::vector<double> places(static_cast<std::size_t>(along.cols()));
    Eigen::VectorXd::Map(places.data(), along.cols()) = along.row(d).transpose();
    std::partial_sort(places.begin(), places.begin() + last + 1, places.end(), std::greater<>());
    const double scale =
        Eigen::VectorXd::Map(places.data(), last).mean() - places[static_cast<std::size_t>(last)];
    beyond(d) = kTailScales * scale * std::clamp(outermost(d) / farthest, 0.0, 1.0);
  }
  return beyond;
}

/// Sets the distance that other poses may have from the places.
void add_reach(WhatWasMeasured& measured) {
  const Eigen::Matrix3Xd& places = measured.flange_B;
  if (places.cols() < 2) return;
  const std::vector<double> distances = distances_to_neighbours(places);
  const auto within = [&](double share) {
    return distances[static_cast<std::size_t>(share * static_cast<double>(distances.size() - 1))];
  };
  const double least =
      kLeastReach * (places.rowwise().maxCoeff() - places.rowwise().minCoeff()).norm();
  const double few = 1 + kFew / static_cast<double>(places.cols());
  measured.reach = std::max(kBeyond * few * within(kNeighbour), least) + kRounding;
  const Eigen::MatrixXd along = along_outline(places);
  measured.outline = along.rowwise().maxCoeff().array() +
                     beyond_outermost(along).array().max(std::max(within(0.5), least)) + kRounding;
}

/// One row per joint vector, chosen evenly if there are too many.
std::vector<Eigen::Index> rows_to_keep(const MeasurementBatch& batch) {
  const std::vector<PoseGroup> groups = pose_groups(batch);
  const std::size_t step = groups.size() / static_cast<std::size_t>(kPlaces) + 1;
  std::vector<Eigen::Index> rows;
  for (std::size_t g = 0; g < groups.size(); g += step) rows.push_back(groups[g].front());
  return rows;
}

/// m³ of the box within `reach` of a place.
double volume_near(const Eigen::Matrix3Xd& places, const Vector3& lower, const Vector3& upper,
                   double reach) {
  const Vector3 cell = (upper - lower) / kCells;
  int near = 0;
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    const Vector3 middle(i % kCells + 0.5, i / kCells % kCells + 0.5, i / (kCells * kCells) + 0.5);
    near += nearest(places, lower + cell.cwiseProduct(middle)) <= reach ? 1 : 0;
  }
  return near * cell.prod();
}

void count_sides(const PoseContext& context, std::vector<WhatWasMeasured::Approaches>& approaches) {
  for (std::size_t j = 0; j < context.direction.size(); ++j) {
    approaches[j].rising += context.direction[j] > 0 ? 1 : 0;
    approaches[j].falling += context.direction[j] < 0 ? 1 : 0;
  }
}

void widen(const std::optional<double>& by, std::optional<std::pair<double, double>>& range) {
  if (!by) return;
  if (!range) range = {*by, *by};
  range = {std::min(range->first, *by), std::max(range->second, *by)};
}

enum class Side { kUnknown, kBoth, kAbove, kBelow };

Side side_of(const WhatWasMeasured::Approaches& one) {
  const auto [rarer, other] = std::minmax(one.rising, one.falling);
  if (other == 0) return Side::kUnknown;
  if (rarer >= kBothSides * (rarer + other)) return Side::kBoth;
  return one.rising > one.falling ? Side::kBelow : Side::kAbove;
}

/// The joints of a side: ` in joints 1 2`; empty for all joints.
std::optional<std::string> joints_of(const WhatWasMeasured& measured, Side side) {
  std::vector<std::size_t> joints;
  for (std::size_t j = 0; j < measured.approaches.size(); ++j)
    if (side_of(measured.approaches[j]) == side) joints.push_back(j + 1);
  if (joints.empty()) return std::nullopt;
  if (joints.size() == measured.approaches.size()) return "";
  return fmt::format(" in joint{} {}", joints.size() == 1 ? "" : "s", fmt::join(joints, " "));
}

/// `from both sides in joints 1 2, from above in joint 3`, for the sides in `sides`. `every` begins
/// the text if all joints share a side.
std::string sides_text(const WhatWasMeasured& measured,
                       const std::vector<std::pair<Side, const char*>>& sides, const char* every) {
  std::string text;
  for (const auto& [side, name] : sides) {
    const auto joints = joints_of(measured, side);
    if (joints)
      text += (text.empty() ? "" : ", ") +
              (joints->empty() ? every + std::string(name) : name + *joints);
  }
  return text;
}

/// Poses in one plane or about one point have none.
std::string cubic_metres(double volume) {
  constexpr double kLeast = 1e-3;
  return volume < kLeast ? "less than 0.001 m³" : fmt::format("{:.3g} m³", volume);
}

std::string volume_text(const WhatWasMeasured& measured) {
  std::string text;
  for (int k = 0; k < 3; ++k)
    text += fmt::format("{}{} {:.0f} to {:.0f}", k == 0 ? "" : ", ", "xyz"[k],
                        to_mm(measured.lower(k)), to_mm(measured.upper(k)));
  text += " mm of the tool from the robot's base";
  if (!measured.reach) return text;
  return text + fmt::format(", {} of this box within {:.0f} mm of a measured place",
                            cubic_metres(measured.volume), to_mm(*measured.reach));
}

}  // namespace

bool WhatWasMeasured::is_near(const Chain& robot, const JointVector& q) const {
  if (!reach) return true;
  const Vector3 place = robot.flange_pose(q).translation();
  const bool inside =
      outline.size() == 0 || (along_outline(place).array() <= outline.array()).all();
  return inside && nearest(flange_B, place) <= *reach;
}

bool WhatWasMeasured::is_side_measured(const PoseContext& context) const {
  const std::size_t said = std::min(approaches.size(), context.direction.size());
  for (std::size_t j = 0; j < said; ++j) {
    const Side side = side_of(approaches[j]);
    if ((side == Side::kBelow && context.direction[j] < 0) ||
        (side == Side::kAbove && context.direction[j] > 0))
      return false;
  }
  return true;
}

double WhatWasMeasured::range_margin() const {
  const double places = std::max(1.0, static_cast<double>(flange_B.cols()));
  return std::min(kMostMargin, kUsualMargin + kMarginOfFew / (places * places));
}

WhatWasMeasured what_was_measured(const PhysicalModel& physics, const MeasurementBatch& batch) {
  WhatWasMeasured measured;
  measured.poses = static_cast<int>(batch.measurements.size());
  measured.approaches.resize(static_cast<std::size_t>(physics.cell->robot.size()));
  const Pose X_BW = physics.X_WB.inverse();
  Eigen::Matrix3Xd tool_B(3, measured.poses);
  for (Eigen::Index i = 0; i < tool_B.cols(); ++i) {
    const PoseContext& context = batch.measurements[static_cast<std::size_t>(i)].context;
    tool_B.col(i) = X_BW * physics.nominal_pose_W(context).translation();
    count_sides(context, measured.approaches);
    widen(context.temperature, measured.temperature);
  }
  measured.lower = tool_B.rowwise().minCoeff();
  measured.upper = tool_B.rowwise().maxCoeff();
  const std::vector<Eigen::Index> rows = rows_to_keep(batch);
  measured.flange_B.resize(3, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const JointVector& q = batch.measurements[static_cast<std::size_t>(rows[k])].context.q;
    measured.flange_B.col(static_cast<Eigen::Index>(k)) =
        physics.cell->robot.flange_pose(q).translation();
  }
  measured.one_place = is_each_tool_at_one_place(batch);
  add_reach(measured);
  if (measured.reach)
    measured.volume =
        volume_near(tool_B(Eigen::all, rows), measured.lower, measured.upper, *measured.reach);
  return measured;
}

void add_what_is_stated(const PhysicalModel& physics, const MeasurementBatch& batch,
                        WhatWasMeasured& measured) {
  constexpr double kSmall = 1e-6;  // rad
  constexpr std::size_t kAsked = 50;
  measured.stated = sigma_of_rows(batch);
  measured.rounding = coarse_rounding(batch, *physics.cell);
  const auto step = joint_step(batch);
  if (!step) return;
  double sum = 0;
  const std::size_t every = batch.measurements.size() / kAsked + 1;
  std::size_t asked = 0;
  for (std::size_t i = 0; i < batch.measurements.size(); i += every, ++asked) {
    PoseContext context = batch.measurements[i].context;
    const Vector3 place = physics.nominal_pose_W(context).translation();
    for (int j = 0; j < context.q.size(); ++j) {
      if (physics.cell->robot.joint(j).type != JointType::kRevolute) continue;
      context.q(j) += kSmall;
      sum += ((physics.nominal_pose_W(context).translation() - place) / kSmall).squaredNorm();
      context.q(j) -= kSmall;
    }
  }
  measured.joint_rounding = {*step, *step * std::sqrt(sum / (36.0 * static_cast<double>(asked)))};
}

std::string one_sided(const std::optional<WhatWasMeasured>& measured) {
  return measured ? sides_text(*measured,
                               {{Side::kAbove, "from above"}, {Side::kBelow, "from below"}}, "")
                  : "";
}

MeasuredWords words_of(const std::optional<WhatWasMeasured>& measured, const Cell& cell) {
  const std::string instrument = papers_of(cell).value_or(CellPapers{}).instrument;
  MeasuredWords words{
      kNotOnRecord, kNotOnRecord, kNotOnRecord,
      fmt::format(
          "{}, {:.4g} mm (1 sigma, per axis) as stated",
          instrument.empty() ? "an instrument that the cell file does not name" : instrument,
          to_mm(cell.tracker.sigma))};
  if (!measured) return words;
  words.sides = sides_text(*measured,
                           {{Side::kBoth, "from both sides"},
                            {Side::kAbove, "from above only"},
                            {Side::kBelow, "from below only"},
                            {Side::kUnknown, "from a side that is not recorded"}},
                           "every joint ");
  words.temperature = !measured->temperature ? "not measured"
                                             : fmt::format("{:.1f} to {:.1f} degrees Celsius",
                                                           measured->temperature->first,
                                                           measured->temperature->second);
  words.volume = volume_text(*measured);
  return words;
}

std::string in_words(const std::optional<WhatWasMeasured>& measured, const Cell& cell) {
  const MeasuredWords words = words_of(measured, cell);
  const std::string poses =
      measured ? fmt::format("{} training pose{}", measured->poses, measured->poses == 1 ? "" : "s")
               : std::string("training poses of which the model tells little");
  return fmt::format("{}; sides of approach: {}; temperature: {}; volume: {}; instrument: {}",
                     poses, words.sides, words.temperature, words.volume, words.instrument);
}

}  // namespace trammel
