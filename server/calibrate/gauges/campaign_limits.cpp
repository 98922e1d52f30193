#include "server/calibrate/gauges/campaign_limits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "server/base/units.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/gauges.h"

namespace trammel {

namespace {

constexpr double kSameMotion = 1e-6;   // m: singular values of a metre's arm
constexpr double kShortStroke = 0.05;  // of the length

/// The equations with which a known anchor fixes a motion [shift; turn] of the whole in W, one per
/// row.
Eigen::MatrixXd held_by(const Anchor& anchor) {
  Eigen::Matrix<double, 3, 6> motion;  // of the anchor's point
  motion << Matrix3::Identity(), -skew(*anchor.p_W);
  Eigen::Matrix<double, 3, 6> turned = Eigen::Matrix<double, 3, 6>::Zero();  // of the direction
  turned.rightCols<3>() = -skew(anchor.direction_W);
  Eigen::MatrixXd rows(6, 6);
  const Vector3& n = anchor.direction_W;
  switch (anchor.shape) {
    case Anchor::Shape::kPlane:
      rows << n * (n.transpose() * motion), turned;
      return rows;
    case Anchor::Shape::kRing:
      rows << motion - n * (n.transpose() * motion), turned;
      return rows;
    case Anchor::Shape::kPoint:
    case Anchor::Shape::kSphere:
      break;
  }
  return motion;
}

std::set<std::string> used_anchors(const MeasurementBatch& batch) {
  std::set<std::string> used;
  for (const Measurement& m : batch.measurements) {
    if (m.gauge) used.insert(m.gauge->anchor);
  }
  return used;
}

bool is_of_base_or_instruments(const std::string& name, const PhysicalModel& model) {
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().part != causes::Part::kBase && !is_of_instruments(*source)) continue;
    const auto& own = source->parameters();
    if (std::any_of(own.begin(), own.end(), [&](const Parameter& one) { return one.name == name; }))
      return true;
  }
  return false;
}

std::string untold_sentence(int untold) {
  switch (untold) {
    case 6:
      return "no anchor's place is known, so distances and touches do not tell where the base "
             "stands and how it is turned: these six numbers stay as the cell file has them, and "
             "anchors are told in that frame; positions, or three known anchors that are not on "
             "one line, would tell; where the base's own frame is all that counts, train without "
             "base (--level geometry,compliance)";
    case 3:
      return "one known anchor does not tell how the base is turned about it; two more known "
             "anchors would";
    case 1:
      return "the known anchors do not tell how the base is turned about the line through them; a "
             "third one beside it would";
    default:
      return fmt::format(
          "the known anchors leave {} of the 6 numbers of the base open; more of them would tell",
          untold);
  }
}

/// Reports undetermined motions of the base in words, in place of the equivalent combinations of
/// parameters.
void add_untold_base(const MeasurementBatch& batch, CalibrationResult& found) {
  const int untold = untold_motions(found.model, batch);
  if (untold == 0) return;
  UnidentifiableCombination base{0, {}, untold_sentence(untold)};
  for (const ErrorSourcePtr& source : found.model.sources) {
    if (source->cause().part != causes::Part::kBase) continue;
    for (const Parameter& parameter : source->parameters())
      base.parameters.push_back(parameter.name);
  }
  if (base.parameters.empty()) return;  // by definition the base is where the cell file has it
  std::erase_if(found.unidentifiable, [&](const UnidentifiableCombination& one) {
    return std::all_of(one.parameters.begin(), one.parameters.end(), [&](const std::string& name) {
      return is_of_base_or_instruments(name, found.model);
    });
  });
  found.unidentifiable.insert(found.unidentifiable.begin(), std::move(base));
}

/// Relative standard deviation of the length of all links together; empty if the model has no
/// lengths.
std::optional<double> stddev_of_size(const CalibrationResult& found) {
  const Chain& robot = found.model.cell->robot;
  std::map<std::string, double> lengths;
  for (int j = 0; j < robot.size(); ++j) {
    lengths[fmt::format("d{}", j + 1)] = robot.joint(j).link.d;
    lengths[fmt::format("a{}", j + 1)] = robot.joint(j).link.a;
  }
  const auto P = static_cast<Eigen::Index>(found.parameters.size());
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(P);
  for (Eigen::Index k = 0; k < P; ++k) {
    const Parameter& parameter = found.parameters[static_cast<std::size_t>(k)].parameter;
    const auto length = lengths.find(parameter.name);
    if (length != lengths.end()) weight(k) = length->second;
  }
  if (weight.squaredNorm() == 0) return std::nullopt;
  weight /= weight.squaredNorm();
  return std::sqrt(std::max(0.0, weight.dot(found.covariance * weight)));
}

struct Stroke {
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  int count = 0;
};

std::map<std::string, Stroke> strokes_of(const MeasurementBatch& batch) {
  std::map<std::string, Stroke> strokes;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->kind != Gauge::Kind::kDistance || m.gauge->minus != nullptr) continue;
    Stroke& stroke = strokes[m.gauge->anchor];
    stroke.shortest = std::min(stroke.shortest, m.gauge->value);
    stroke.longest = std::max(stroke.longest, m.gauge->value);
    ++stroke.count;
  }
  return strokes;
}

/// m: the length of all links, one after the other.
double reach_of(const Chain& robot) {
  double reach = 0;
  for (int j = 0; j < robot.size(); ++j)
    reach += std::hypot(robot.joint(j).link.a, robot.joint(j).link.d);
  return reach;
}

std::string size_text(const CalibrationResult& found, const PlacedAnchor& anchor) {
  if (anchor.zero < 0)
    return "so the robot's size (all lengths alike) is known as well as the instrument's length "
           "is, which is taken as exact; zero_mm: null in the cell file says that it is not";
  const std::string alike =
      "so the instrument's zero and the robot's size (all lengths alike) change the distances "
      "nearly alike";
  const std::string advice =
      "a calibrated length (zero_mm), or distances of other lengths, would tell";
  const std::optional<double> stddev = stddev_of_size(found);
  if (!stddev) return fmt::format("{}; {}", alike, advice);
  return fmt::format(
      "{}: the size is known to {:.0f} ppm (U, k=2), {:.2g} mm over the links' {:.1f} m; {}", alike,
      2e6 * *stddev, to_mm(2 * *stddev * reach_of(found.model.cell->robot)),
      reach_of(found.model.cell->robot), advice);
}

void add_short_strokes(const MeasurementBatch& batch, CalibrationResult& found) {
  if (has_positions(batch)) return;
  const auto strokes = strokes_of(batch);
  // Instruments of different lengths together determine a size that no single one determines.
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (const auto& [id, stroke] : strokes) {
    shortest = std::min(shortest, stroke.shortest);
    longest = std::max(longest, stroke.longest);
  }
  if (longest - shortest >= kShortStroke * longest) return;
  for (const auto& [id, stroke] : strokes) {
    const PlacedAnchor anchor = placed_anchor(found.model, id);
    UnidentifiableCombination size{0, {}, ""};
    if (anchor.zero >= 0) size.parameters.push_back(fmt::format("zero[{}]", id));
    size.sentence = fmt::format(
        "anchor {}: all {} distances are between {:.2f} and {:.2f} mm, {}; poses farther from it "
        "than that were not measured, and nothing shows what the robot does there",
        id, stroke.count, to_mm(stroke.shortest), to_mm(stroke.longest), size_text(found, anchor));
    found.unidentifiable.push_back(std::move(size));
  }
}

/// True if some row compares the arm with a length: contacts and touches of planes and points with
/// unknown places fit an arm of every size.
bool tells_size(const PhysicalModel& model, const MeasurementBatch& batch) {
  const auto tells = [&](const Measurement& m) {
    if (!m.gauge || m.gauge->kind == Gauge::Kind::kDistance ||
        m.gauge->kind == Gauge::Kind::kApart || m.gauge->minus != nullptr)
      return true;
    const PlacedAnchor anchor = placed_anchor(model, m.gauge->anchor);
    return anchor.said == nullptr || anchor.said->p_W.has_value() || anchor.said->radius > 0;
  };
  return std::any_of(batch.measurements.begin(), batch.measurements.end(), tells);
}

void add_untold_size(const MeasurementBatch& batch, CalibrationResult& found) {
  if (tells_size(found.model, batch)) return;
  found.unidentifiable.push_back(
      {0,
       {},
       "contacts and touches at unknown places fit an arm of every size, so they do not tell the "
       "robot's size (all lengths alike): it stays as drawn; one known length between two poses "
       "(distance_mm with from_pose_id) would tell"});
}

}  // namespace

int untold_motions(const PhysicalModel& model, const MeasurementBatch& batch) {
  if (has_positions(batch)) return 0;
  Eigen::MatrixXd held = Eigen::MatrixXd::Zero(0, 6);
  for (const std::string& id : used_anchors(batch)) {
    const PlacedAnchor anchor = placed_anchor(model, id);
    if (anchor.said == nullptr || !anchor.said->p_W) continue;
    const Eigen::MatrixXd rows = held_by(*anchor.said);
    held.conservativeResize(held.rows() + rows.rows(), 6);
    held.bottomRows(rows.rows()) = rows;
  }
  if (held.rows() == 0) return 6;
  const Eigen::VectorXd seen = Eigen::JacobiSVD<Eigen::MatrixXd>(held).singularValues();
  return 6 - static_cast<int>((seen.array() > kSameMotion).count());
}

void add_campaign_limits(const MeasurementBatch& batch, CalibrationResult& found) {
  add_untold_base(batch, found);
  add_short_strokes(batch, found);
  add_untold_size(batch, found);
}

}  // namespace trammel
