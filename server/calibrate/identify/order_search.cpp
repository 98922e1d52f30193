#include "server/calibrate/identify/order_search.h"

#include <algorithm>

#include "server/calibrate/identify/identify.h"
#include "server/calibrate/identify/weighting.h"
#include "server/error_sources/anchors.h"

namespace trammel {

namespace {

constexpr double kDamping = 1e-9;  // of the trace
constexpr int kRefinement = 100;   // of a step of the search: finer orders change no residual

/// An order, and the part of the residuals that its sine and cosine explain.
struct FoundOrder {
  double order = 0;  // cycles a turn of the joint
  double gain = 0;   // weighted sum of squares explained
};

/// `q`: joint angles, rad; `along`: weighted residual along the joint's Jacobian column; `square`:
/// weighted square of that column. All of size N.
FoundOrder fit_order(const Eigen::VectorXd& q, const Eigen::VectorXd& along,
                     const Eigen::VectorXd& square, double order) {
  const Eigen::ArrayXd sine = (order * q.array()).sin();
  const Eigen::ArrayXd cosine = (order * q.array()).cos();
  Eigen::Matrix2d normal;
  normal(0, 0) = (square.array() * sine * sine).sum();
  normal(0, 1) = normal(1, 0) = (square.array() * sine * cosine).sum();
  normal(1, 1) = (square.array() * cosine * cosine).sum();
  // A little damping: near order 0, or with few poses, the two columns are alike.
  normal += kDamping * normal.trace() * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d right((along.array() * sine).sum(), (along.array() * cosine).sum());
  const Eigen::Vector2d amplitude = normal.inverse() * right;
  return {order, amplitude.dot(right)};
}

/// Periodogram in joint space with unequal weights: over `search`, then refined to a hundredth of
/// its step.
FoundOrder search_order(const Eigen::VectorXd& q, const Eigen::VectorXd& along,
                        const Eigen::VectorXd& square, const ErrorSource::Search& search) {
  FoundOrder best;
  const auto consider = [&](double order) {
    const FoundOrder candidate = fit_order(q, along, square, std::max(order, search.from));
    if (candidate.gain > best.gain) best = candidate;
  };
  for (double order = search.from; order <= search.to; order += search.step) consider(order);
  for (double step = search.step / 4; step > search.step / kRefinement; step /= 2) {
    const double centre = best.order;
    for (int k = -4; k <= 4; ++k) consider(centre + k * step);
  }
  return best;
}

/// First value index of each source.
std::vector<Eigen::Index> first_values(const PhysicalModel& model) {
  std::vector<Eigen::Index> first;
  Eigen::Index next = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    first.push_back(next);
    next += static_cast<Eigen::Index>(source->parameters().size());
  }
  return first;
}

/// `model` without the sources in `left_out` (indices).
PhysicalModel without(const PhysicalModel& model, const std::vector<std::size_t>& left_out) {
  PhysicalModel less = model;
  less.sources.clear();
  std::vector<double> values;
  const std::vector<Eigen::Index> first = first_values(model);
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    if (std::find(left_out.begin(), left_out.end(), k) != left_out.end()) continue;
    less.sources.push_back(model.sources[k]);
    for (std::size_t i = 0; i < model.sources[k]->parameters().size(); ++i) {
      values.push_back(model.values(first[k] + static_cast<Eigen::Index>(i)));
    }
  }
  less.values =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  return less;
}

/// The effect of a joint on the measurements: weighted residual along its column, and weighted
/// square of the column.
struct AlongJoint {
  double q = 0, along = 0, square = 0;
};

Vector3 joint_column(const PhysicalModel& model, const PoseContext& context, int joint) {
  const Pose X_FT = model.tools.at(context.tool);
  return model.X_WB.linear() *
         model.cell->robot.gear_jacobian(context.q, X_FT.translation()).col(joint).head<3>();
}

double gear_angle(const PhysicalModel& model, const PoseContext& context, int joint) {
  return model.cell->robot.gear_angles(context.q)(joint);
}

AlongJoint of_position(const PhysicalModel& model, const Measurement& m, int joint,
                       const Vector3& residual, double variance) {
  const Vector3 column = joint_column(model, m.context, joint);
  return {gear_angle(model, m.context, joint), column.dot(residual) / variance,
          column.squaredNorm() / variance};
}

/// The effect on a gauge told against another pose, or from it, as if the joint did nothing there:
/// enough to find an order.
AlongJoint of_gauge(const PhysicalModel& model, const Measurement& m, int joint, double residual,
                    double variance) {
  const Vector3 p_W = model.pose_W(m.context).translation();
  const GaugedLength length =
      m.gauge->kind == Gauge::Kind::kApart
          ? length_of(p_W - model.pose_W(*m.gauge->minus).translation())
          : gauged_length(m.gauge->kind, placed_anchor(model, m.gauge->anchor).at(model.values),
                          p_W);
  const double column = length.by_point_W.dot(joint_column(model, m.context, joint));
  return {gear_angle(model, m.context, joint), column * residual / variance,
          column * column / variance};
}

/// The order of `source` that explains most of the residuals through its joint's Jacobian column.
FoundOrder best_order(const ErrorSource& source, const PhysicalModel& model,
                      const MeasurementBatch& batch, const Residuals& r, const Weights& weights) {
  const Eigen::Index positions = r.position.cols();
  const Eigen::Index n = positions + r.gauge.size();
  const double own = weights.discrepancy * weights.discrepancy;
  const auto measurement = [&](Eigen::Index i) -> const Measurement& {
    return batch.measurements[static_cast<std::size_t>(i)];
  };
  Eigen::VectorXd q(n), along(n), square(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    AlongJoint one;
    if (i < positions) {
      one = of_position(model, measurement(r.positions[static_cast<std::size_t>(i)]),
                        source.joint(), r.position.col(i), r.sigma(i) * r.sigma(i) + own);
    } else {
      const Eigen::Index k = i - positions;
      one = of_gauge(model, measurement(r.gauges[static_cast<std::size_t>(k)]), source.joint(),
                     r.gauge(k), r.sigma_gauge(k) * r.sigma_gauge(k) + r.poses_of_gauge(k) * own);
    }
    q(i) = one.q;
    along(i) = one.along;
    square(i) = one.square;
  }
  return search_order(q, along, square, *source.search());
}

}  // namespace

Status search_orders(CalibrationProblem& problem, const CalibrateOptions& options) {
  PhysicalModel& model = problem.model;
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    if (model.sources[k]->search()) open.push_back(k);
  }
  const std::vector<Eigen::Index> first = first_values(model);
  while (!open.empty()) {
    const CalibrationResult found = TRY(identify({without(model, open), problem.batch}, options));
    const MeasurementBatch batch = aligned(problem.batch, found.sessions, model.cell->tracker);
    const Residuals r = residuals_of(found.model, batch, found.model.values);
    const Weights weights = weights_of(found, batch);
    FoundOrder best;
    std::size_t strongest = open.front();
    for (const std::size_t k : open) {
      const FoundOrder candidate = best_order(*model.sources[k], found.model, batch, r, weights);
      if (candidate.gain > best.gain) {
        best = candidate;
        strongest = k;
      }
    }
    model.values(first[strongest]) = best.order;
    open.erase(std::find(open.begin(), open.end(), strongest));
  }
  return {};
}

std::string with_likeliest_order(const ErrorSource& source, const CalibrationResult& found,
                                 const MeasurementBatch& batch) {
  const MeasurementBatch there = aligned(batch, found.sessions, found.model.cell->tracker);
  const Residuals r = residuals_of(found.model, there, found.model.values);
  const FoundOrder best = best_order(source, found.model, there, r, weights_of(found, batch));
  return fmt::format("{}@{:.4f}", source.name(), best.order);
}

std::map<std::string, std::string> found_orders(const PhysicalModel& model) {
  std::map<std::string, std::string> found;
  const std::vector<Eigen::Index> first = first_values(model);
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    const ErrorSource& source = *model.sources[k];
    if (source.search())
      found[source.name()] = fmt::format("{}@{:.4f}", source.name(), model.values(first[k]));
  }
  return found;
}

}  // namespace trammel
