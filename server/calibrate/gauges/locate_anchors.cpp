#include "server/calibrate/gauges/locate_anchors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/calibrate/frames/frames.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

constexpr std::size_t kFewest = 4;     // values for the three coordinates of an anchor, and one to
                                       // check them
constexpr double kLeastBeside = 1e-2;  // m rms: tool points closer to one line than this do not
                                       // determine the other two directions
constexpr std::size_t kFewestContacts = 2;  // the first one only places the point
constexpr double kMostTilted = 0.5;         // cosine of the angle from the stated normal
constexpr int kRefinements = 50;
constexpr double kLastStep = 1e-9;  // m

/// The lengths measured to one anchor.
struct Lengths {
  std::vector<Vector3> points_W;
  std::vector<double> lengths;           ///< m, from the anchor's point, or above its plane
  std::vector<Vector3> contacts_W = {};  ///< tool points that met the anchor's point
};

std::map<std::string, Lengths> lengths_of(const PhysicalModel& model,
                                          const MeasurementBatch& batch) {
  std::map<std::string, Lengths> all;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->kind == Gauge::Kind::kApart) continue;
    const PlacedAnchor anchor = placed_anchor(model, m.gauge->anchor);
    if (anchor.place < 0) continue;
    Lengths& one = all[m.gauge->anchor];
    if (m.gauge->minus != nullptr) continue;
    const Vector3 p_W = model.pose_W(m.context).translation();
    if (m.gauge->kind == Gauge::Kind::kContact) {
      one.contacts_W.push_back(p_W);
      continue;
    }
    one.points_W.push_back(p_W);
    const double surface = m.gauge->kind == Gauge::Kind::kTouch ? anchor.said->radius : 0;
    one.lengths.push_back(m.gauge->value + surface - anchor.said->zero.value_or(0));
  }
  return all;
}

/// The spread of the points: their mean, and singular vectors and rms along them, largest first.
struct Spread {
  Vector3 mean = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();
  Vector3 rms = Vector3::Zero();
};

Spread spread_of(const std::vector<Vector3>& points) {
  const auto n = static_cast<Eigen::Index>(points.size());
  const Eigen::Map<const Eigen::Matrix3Xd> p(points.front().data(), 3, n);
  Spread spread;
  spread.mean = p.rowwise().mean();
  const Eigen::Matrix3Xd from_mean = p.colwise() - spread.mean;
  const Eigen::JacobiSVD<Eigen::Matrix3Xd> svd(from_mean, Eigen::ComputeFullU);
  spread.axes = svd.matrixU();
  spread.rms = svd.singularValues() / std::sqrt(static_cast<double>(n));
  return spread;
}

/// |p - a|² = d² is linear in a and |a|².
Vector3 linear_place(const Lengths& of, const Vector3& mean) {
  const auto n = static_cast<Eigen::Index>(of.lengths.size());
  Eigen::MatrixXd A(n, 4);
  Eigen::VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Vector3 p = of.points_W[at] - mean;
    A.row(i) << -2 * p.transpose(), 1;
    b(i) = of.lengths[at] * of.lengths[at] - p.squaredNorm();
  }
  return mean + A.completeOrthogonalDecomposition().solve(b).head<3>();
}

struct Refined {
  Vector3 p_W = Vector3::Zero();
  double square = std::numeric_limits<double>::infinity();  ///< m², sum
};

/// Gauss-Newton steps, damped if one leads uphill.
Refined refined_from(Vector3 a, const Lengths& of) {
  const auto square_at = [&](const Vector3& place) {
    double sum = 0;
    for (std::size_t i = 0; i < of.lengths.size(); ++i)
      sum += std::pow(of.lengths[i] - (of.points_W[i] - place).norm(), 2);
    return sum;
  };
  double square = square_at(a), damping = 1e-6;
  for (int k = 0; k < kRefinements; ++k) {
    Matrix3 normal = Matrix3::Zero();
    Vector3 right = Vector3::Zero();
    for (std::size_t i = 0; i < of.lengths.size(); ++i) {
      const Vector3 d = of.points_W[i] - a;
      const Vector3 u = d / std::max(d.norm(), kLastStep);
      normal += u * u.transpose();
      right -= (of.lengths[i] - d.norm()) * u;
    }
    normal.diagonal() *= 1 + damping;
    normal.diagonal().array() += 1e-12;
    const Vector3 step = normal.ldlt().solve(right);
    const double next = square_at(a + step);
    if (next <= square) {
      a += step;
      square = next;
      damping /= 10;
      if (step.norm() < kLastStep) break;
    } else {
      damping = std::max(10 * damping, 1e-6);
    }
  }
  return {a, square};
}

/// From the linear solution and from its mirror image behind the points: nearly in a plane, they
/// fit both alike.
Vector3 place_of(const Lengths& of, const Spread& spread) {
  const Vector3 linear = linear_place(of, spread.mean);
  const Vector3 n = spread.axes.col(2);
  const double mean_length =
      std::sqrt(std::inner_product(of.lengths.begin(), of.lengths.end(), of.lengths.begin(), 0.0) /
                static_cast<double>(of.lengths.size()));
  const Vector3 within = linear - n.dot(linear - spread.mean) * n;
  Refined best;
  for (const Vector3& start :
       {linear, Vector3(linear - 2 * n.dot(linear - spread.mean) * n),
        Vector3(within + mean_length * n), Vector3(within - mean_length * n)}) {
    const Refined found = refined_from(start, of);
    if (found.square < best.square) best = found;
  }
  return best.p_W;
}

/// m: touches whose mean is this small touch the anchor point itself.
constexpr double kAtThePoint = 1e-3;

/// True if the tool point is at one anchor in all rows, wherever that anchor is.
bool is_about_one_point(const PhysicalModel& model, const MeasurementBatch& batch) {
  return !batch.measurements.empty() &&
         std::all_of(
             batch.measurements.begin(), batch.measurements.end(), [&](const Measurement& m) {
               if (!m.gauge || m.gauge->minus) return false;
               if (m.gauge->kind == Gauge::Kind::kContact)
                 return m.gauge->anchor == batch.measurements.front().gauge->anchor;
               if (m.gauge->kind != Gauge::Kind::kTouch) return false;
               const Anchor* said = placed_anchor(model, m.gauge->anchor).said;
               const bool is_point =
                   said->shape == Anchor::Shape::kPoint || said->shape == Anchor::Shape::kSphere;
               return is_point && m.gauge->anchor == batch.measurements.front().gauge->anchor &&
                      std::abs(m.gauge->value + said->radius) < kAtThePoint;
             });
}

/// Names the measurement that determines an unknown tool in place of gauges.
std::string way_to_the_tool(const PhysicalModel& model, const MeasurementBatch& batch) {
  constexpr const char* kHow =
      "write x_mm, y_mm and z_mm, all 0, in each such row in place of touch_mm or distance_mm and "
      "anchor_id (the point is then the origin of the batch's frame), and base: null in the cell "
      "file: the tool is found from how the flange turns about the point (trammel export-robot "
      "writes it); how the base is turned about it stays unknown";
  if (is_about_one_point(model, batch))
    return fmt::format("the tool's point is at one place in all rows: {}", kHow);
  return fmt::format(
      "write where it sits to some mm, or measure some positions; or let its point touch one point "
      "in ten orientations or more: {}",
      kHow);
}

Status check_told(const std::string& id, const Lengths& of) {
  if (of.lengths.size() < kFewest) {
    return refused(
               "anchor '{}': {} values told of themselves, at least {} are needed to find where it "
               "is",
               id, of.lengths.size(), kFewest)
        .of("anchor_id")
        .beyond(of.lengths.size(), kFewest)
        .with_text(id)
        .next("measure more poses, or give its xyz_mm in the cell file");
  }
  const double beside = spread_of(of.points_W).rms(1);
  if (beside >= kLeastBeside) return {};  // of a plane, too
  return refused(
             "anchor '{}': the tool points lie on one line within {:.1f} mm, limit {:g} mm: they "
             "do not tell where it is",
             id, to_mm(beside), to_mm(kLeastBeside))
      .of("anchor_id")
      .with_text(id)
      .beyond(to_mm(beside), to_mm(kLeastBeside))
      .next("measure from all sides, or give its xyz_mm in the cell file");
}

/// The point that the tool met.
Result<Vector3> met_point(const std::string& id, const std::vector<Vector3>& contacts_W) {
  if (contacts_W.size() < kFewestContacts)
    return refused("anchor '{}': the tool met it once, which tells nothing of the arm", id)
        .of("anchor_id")
        .beyond(contacts_W.size(), kFewestContacts)
        .with_text(id)
        .next("meet it in ten postures or more");
  Vector3 mean = Vector3::Zero();
  for (const Vector3& p_W : contacts_W) mean += p_W / static_cast<double>(contacts_W.size());
  return mean;
}

/// Offset and tilts of the plane through the touches.
Result<Vector3> plane_through(const std::string& id, const Lengths& of, const Vector3& stated) {
  const Spread spread = spread_of(of.points_W);
  const Vector3 across = spread.axes.col(2);
  const Vector3 n = across.dot(stated) < 0 ? Vector3(-across) : across;
  if (n.dot(stated) < kMostTilted)
    return refused("anchor '{}': the plane through its touches is {:.0f} deg from plane_normal", id,
                   to_deg(std::acos(n.dot(stated))))
        .of("anchors")
        .with_text(id)
        .next("correct plane_normal in the cell file: it points away from the body");
  const double height = std::accumulate(of.lengths.begin(), of.lengths.end(), 0.0) /
                        static_cast<double>(of.lengths.size());
  Vector3 values;
  values << n.dot(spread.mean) - height, tilt_to(stated, n);
  return values;
}

/// The three values of an unknown anchor.
Result<Vector3> told_values(const std::string& id, const Lengths& of, const PlacedAnchor& anchor) {
  if (!of.contacts_W.empty()) return met_point(id, of.contacts_W);
  TRY(check_told(id, of));
  if (anchor.is_open_plane()) return plane_through(id, of, anchor.said->direction_W);
  return place_of(of, spread_of(of.points_W));
}

}  // namespace

Result<std::vector<std::string>> with_instruments(std::vector<std::string> specs, const Cell& cell,
                                                  const MeasurementBatch& batch) {
  if (!has_gauges(batch)) return specs;
  const Anchors anchors = TRY(anchors_of(cell));
  const bool open =
      std::any_of(batch.measurements.begin(), batch.measurements.end(), [&](const Measurement& m) {
        const auto anchor = m.gauge ? anchors.find(m.gauge->anchor) : anchors.end();
        return anchor != anchors.end() && anchor->second.zero_open;
      });
  const auto add = [&](std::string_view spec) {
    if (std::find(specs.begin(), specs.end(), spec) == specs.end()) specs.emplace_back(spec);
  };
  if (!anchors.empty()) add(kAnchors);
  if (open) add(kInstrumentZero);
  return specs;
}

Status check_gauges(const PhysicalModel& model, const MeasurementBatch& batch) {
  if (!has_gauges(batch)) return {};
  if (has_sessions(batch)) {
    return refused("distances or touches in a batch of {} set-ups of the instrument",
                   batch.sessions.size())
        .in("batch " + batch.id)
        .of("session_id")
        .next("give each set-up that has them to a training of its own");
  }
  for (const Measurement& m : batch.measurements) {
    if (m.gauge && m.gauge->kind != Gauge::Kind::kApart &&
        placed_anchor(model, m.gauge->anchor).said == nullptr)
      return refused("no anchor '{}' in the cell file", m.gauge->anchor)
          .in("batch " + batch.id)
          .at_row(m.row)
          .of("anchor_id")
          .with_text(m.gauge->anchor)
          .next("a point that the tool met stands there as anchors: {spike: {xyz_mm: null}}");
  }
  const Cell& cell = *model.cell;
  if (has_positions(batch) || (cell.X_WB && !has_unknown_tool(cell))) return {};
  return refused("distances alone do not tell where {} is that cell {} calls unknown",
                 !cell.X_WB ? "the base" : "a tool", cell.name)
      .in("batch " + batch.id)
      .of(!cell.X_WB ? "base" : "tools")
      .next(!cell.X_WB ? "write base: {xyz_mm: [0, 0, 0]}, and give anchors' places in the base's "
                         "frame or as null"
                       : way_to_the_tool(model, batch));
}

Status locate_anchors(PhysicalModel& model, const MeasurementBatch& batch) {
  for (const auto& [id, of] : lengths_of(model, batch)) {
    const PlacedAnchor anchor = placed_anchor(model, id);
    const Result<Vector3> values = told_values(id, of, anchor);
    if (!values) return Failure(values.error()).in("batch " + batch.id);
    model.values.segment<3>(anchor.place) = *values;
  }
  return {};
}

std::optional<LocatedPoint> locate_point(const std::vector<Vector3>& points_W,
                                         const std::vector<double>& lengths) {
  const Lengths of{points_W, lengths};
  if (points_W.size() < kFewest) return std::nullopt;
  const Spread spread = spread_of(points_W);
  if (spread.rms(1) < kLeastBeside) return std::nullopt;
  const Vector3 p_W = place_of(of, spread);
  std::vector<double> off;
  for (std::size_t i = 0; i < lengths.size(); ++i)
    off.push_back(std::abs(lengths[i] - (points_W[i] - p_W).norm()));
  return LocatedPoint{p_W, median(off)};
}

}  // namespace trammel
