#include "server/calibrate/calibrate.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/calibrate/frames.h"
#include "server/calibrate/order_search.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr int kMaxReweightings = 12;
constexpr double kSettledStep = 0.05;       // standard deviations; a smaller step is the last one
constexpr double kFirstSettledStep = 1;     // the same while residuals only serve to find the discrepancy
constexpr double kNoise = 1e-6;             // of the cost: a rise by less is no rise
constexpr double kSettledSigma = 2e-3;      // share by which a weighting sigma may still change
constexpr Eigen::Index kPosesAtATime = 64;  // whose Jacobians are multiplied together
constexpr double kHuberPosition = 4.03;     // norm that 1 in 1000 exceeds, 3 normal axes
constexpr double kHuberPose = 4.74;         // the same, 6 axes
constexpr double kSuspect = 5.5;            // norm of 3 axes that 1 in 10^6 exceeds
constexpr double kIdentifiedShare = 0.5;    // of the prior's standard deviation, at most, is left of what was not known
constexpr double kNoModelError = 0.025;     // m rms: what no model of a robot leaves,
constexpr double kNoModelShare = 0.05;      // and of how far the positions spread
constexpr double kHeld = 1e-6;              // of the priors of sources that are not to change
constexpr double kUnknownWidening = 500;    // of the priors of an unknown base or tool: 1 m, 2.5 rad

/// Standard deviations with which residuals are weighed: the measurement's and, on top, the model's own.
struct Weights {
  double discrepancy = 0;           // m per axis
  double discrepancy_rotation = 0;  // rad per axis
  bool estimated = false;           // false: still at the measurement's sigma alone
};

double position_sigma(const Measurement& m, const Cell& cell) { return m.sigma.value_or(cell.tracker.sigma); }

/// One measurement's residual in units of sigma; the parameters come in units of their prior scale.
class PoseCost final : public ceres::CostFunction {
 public:
  PoseCost(const PhysicalModel& model, const Eigen::VectorXd& scale, const Measurement& measurement,
           const Weights& weights)
      : model_(model), scale_(scale), measurement_(measurement) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(scale.size()));
    set_num_residuals(measurement.R_WT ? 6 : 3);
    weight_ = 1 / std::hypot(position_sigma(measurement, *model.cell), weights.discrepancy);
    rotation_weight_ = 1 / std::hypot(model.cell->tracker.sigma_rotation, weights.discrepancy_rotation);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::VectorXd values = Eigen::Map<const Eigen::VectorXd>(parameters[0], scale_.size()).cwiseProduct(scale_);
    const bool derivative = jacobians != nullptr && jacobians[0] != nullptr;
    Eigen::MatrixXd J;
    const Pose X_WT = model_.pose_W(measurement_.context, values, derivative ? &J : nullptr);
    Eigen::Map<Eigen::VectorXd> r(residuals, num_residuals());
    r.head<3>() = weight_ * (measurement_.p_W - X_WT.translation());
    Vector3 turn = Vector3::Zero();
    if (measurement_.R_WT) {
      turn = rotation_log(*measurement_.R_WT * X_WT.linear().transpose());
      r.tail<3>() = rotation_weight_ * turn;
    }
    if (derivative) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(
          jacobians[0], num_residuals(), scale_.size());
      // d log(R_m (exp(w) R)ᵀ) = -Jr^-1(turn) w to first order in w, Jr the right Jacobian of SO(3).
      const Matrix3 by_turn = -rotation_weight_ * right_jacobian_inverse(turn);
      for (Eigen::Index k = 0; k < scale_.size(); ++k) {
        out.col(k).head<3>() = -weight_ * scale_(k) * J.col(k).head<3>();
        if (measurement_.R_WT) out.col(k).tail<3>() = scale_(k) * (by_turn * J.col(k).tail<3>());
      }
    }
    return X_WT.translation().allFinite();
  }

 private:
  static Matrix3 right_jacobian_inverse(const Vector3& w) {
    const double angle = w.norm();
    const Matrix3 W = skew(w);
    const double c =
        angle < 1e-4 ? 1.0 / 12 : 1 / (angle * angle) - (1 + std::cos(angle)) / (2 * angle * std::sin(angle));
    return Matrix3::Identity() + 0.5 * W + c * W * W;
  }

  const PhysicalModel& model_;
  const Eigen::VectorXd& scale_;
  const Measurement& measurement_;
  double weight_ = 1;
  double rotation_weight_ = 1;
};

/// (x - prior) in prior units.
class PriorCost final : public ceres::CostFunction {
 public:
  explicit PriorCost(Eigen::VectorXd prior) : prior_(std::move(prior)) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(prior_.size()));
    set_num_residuals(static_cast<int>(prior_.size()));
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Map<Eigen::VectorXd>(residuals, prior_.size()) =
        Eigen::Map<const Eigen::VectorXd>(parameters[0], prior_.size()) - prior_;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::MatrixXd>(jacobians[0], prior_.size(), prior_.size()).setIdentity();
    }
    return true;
  }

 private:
  Eigen::VectorXd prior_;
};

/// All there is to minimise, with the parameters in units of their priors.
struct Scaled {
  std::vector<Parameter> parameters;
  Eigen::VectorXd scale;    // standard deviations of the priors
  Eigen::VectorXd typical;  // the same where nothing was widened
  Eigen::VectorXd prior;    // in units of scale
};

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The priors stand around the model's values. Those of a frame that the cell calls unknown are wide: it was found with
/// a chain that was still wrong.
Scaled scaled(const PhysicalModel& model, const CalibrateOptions& options) {
  const Eigen::Index P = model.parameter_count();
  Scaled s{model.parameters(), Eigen::VectorXd(P), Eigen::VectorXd(P), Eigen::VectorXd(P)};
  Eigen::Index k = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const bool unknown =
        (source->name() == "base" && !model.cell->X_WB) || (source->name() == "tool" && has_unknown_tool(*model.cell));
    for (std::size_t i = 0; i < source->parameters().size(); ++i, ++k) {
      Parameter& parameter = s.parameters[static_cast<std::size_t>(k)];
      s.typical(k) = parameter.prior_scale;
      parameter.prior = model.values(k);
      parameter.prior_scale *= unknown ? kUnknownWidening : 1;
      if (!options.only.empty() && !contains(options.only, source->name())) parameter.prior_scale *= kHeld;
      s.scale(k) = parameter.prior_scale;
      s.prior(k) = parameter.prior / parameter.prior_scale;
    }
  }
  return s;
}

double huber_limit(const Measurement& m) { return m.R_WT ? kHuberPose : kHuberPosition; }

/// Before the discrepancy is known nothing can be called an outlier.
bool is_robust(const CalibrateOptions& options, const Weights& weights) { return options.robust && weights.estimated; }

/// Half the weighted sum of squares about one point, by the parameters in units of their priors; to second order as
/// Gauss and Newton have it.
struct Expansion {
  double cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;  ///< second derivative without the priors' share
};

Expansion expand(const CalibrationProblem& problem, const Scaled& s, const Weights& weights, bool robust,
                 const Eigen::VectorXd& x) {
  const Eigen::Index P = s.scale.size();
  const Eigen::VectorXd from_prior = x - s.prior;
  Expansion at{0.5 * from_prior.squaredNorm(), from_prior, Eigen::MatrixXd::Zero(P, P)};
  Eigen::MatrixXd jacobians(P, 6 * kPosesAtATime);  // one column an equation
  Eigen::VectorXd residuals(6 * kPosesAtATime);
  Eigen::Index filled = 0;
  const auto add_filled = [&] {
    const auto J = jacobians.leftCols(filled);
    at.gradient.noalias() += J * residuals.head(filled);
    at.information.selfadjointView<Eigen::Lower>().rankUpdate(J);
    filled = 0;
  };
  for (const Measurement& m : problem.batch.measurements) {
    const PoseCost cost(problem.model, s.scale, m, weights);
    const double* values = x.data();
    double* jacobian = jacobians.col(filled).data();
    const bool finite = cost.Evaluate(&values, residuals.data() + filled, &jacobian);
    auto r = residuals.segment(filled, cost.num_residuals());
    const double norm = finite ? r.norm() : std::numeric_limits<double>::infinity();
    const double limit = huber_limit(m);
    if (robust && norm > limit) {
      const double root_weight = std::sqrt(limit / norm);
      r *= root_weight;
      jacobians.middleCols(filled, cost.num_residuals()) *= root_weight;
      at.cost += limit * (norm - 0.5 * limit);
    } else {
      at.cost += 0.5 * norm * norm;
    }
    filled += cost.num_residuals();
    if (filled + 6 > residuals.size()) add_filled();
  }
  add_filled();
  at.information = Eigen::MatrixXd(at.information.selfadjointView<Eigen::Lower>());
  return at;
}

/// What minimising came to.
struct Minimum {
  Eigen::VectorXd x;
  Expansion last;  ///< about x, or a negligible step before it
  std::vector<double> costs;
  bool converged = false;
  std::string message;
};

/// Gauss-Newton step from where `at` was taken. Parameters that stand at their bound and would leave it are held.
Eigen::VectorXd bounded_step(const Expansion& at, const Eigen::VectorXd& x, const Eigen::VectorXd& lower) {
  Eigen::VectorXd downhill = -at.gradient;
  Eigen::MatrixXd curvature = at.information;
  curvature.diagonal().array() += 1;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (x(i) > lower(i) || downhill(i) >= 0) continue;
    downhill(i) = 0;
    curvature.row(i).setZero();
    curvature.col(i).setZero();
    curvature(i, i) = 1;
  }
  return (x + curvature.llt().solve(downhill)).cwiseMax(lower) - x;
}

/// Full Gauss-Newton steps, enough wherever the start is near; nothing where one of them leads uphill.
std::optional<Minimum> full_steps(const CalibrationProblem& problem, const Scaled& s, const Weights& weights,
                                  const CalibrateOptions& options, const Eigen::VectorXd& start) {
  Eigen::VectorXd lower(start.size());
  for (Eigen::Index i = 0; i < lower.size(); ++i)
    lower(i) = s.parameters[static_cast<std::size_t>(i)].lower / s.scale(i);
  Minimum now{start.cwiseMax(lower), {}, {}, false, "too many steps"};
  for (int k = 0; k < std::max(1, options.max_iterations) && !now.converged; ++k) {
    now.last = expand(problem, s, weights, is_robust(options, weights), now.x);
    const double cost = now.last.cost;
    if (!std::isfinite(cost) || (k > 0 && cost > now.costs.back() + kNoise)) return std::nullopt;
    now.costs.push_back(cost);
    const Eigen::VectorXd step = bounded_step(now.last, now.x, lower);
    const double in_standard_deviations = std::sqrt(step.dot(now.last.information * step) + step.squaredNorm());
    now.x += step;
    if (in_standard_deviations < (weights.estimated ? kSettledStep : kFirstSettledStep)) {
      now.converged = true;
      now.message = fmt::format("last step {:.1e} standard deviations", in_standard_deviations);
    }
  }
  return now;
}

/// From any start.
Result<Minimum> guarded_steps(const CalibrationProblem& problem, const Scaled& s, const Weights& weights,
                              const CalibrateOptions& calibrate_options, Eigen::VectorXd x) {
  const bool robust = is_robust(calibrate_options, weights);
  ceres::Problem ceres_problem;
  for (const Measurement& m : problem.batch.measurements) {
    ceres_problem.AddResidualBlock(new PoseCost(problem.model, s.scale, m, weights),
                                   robust ? new ceres::HuberLoss(huber_limit(m)) : nullptr, x.data());
  }
  ceres_problem.AddResidualBlock(new PriorCost(s.prior), nullptr, x.data());
  for (std::size_t i = 0; i < s.parameters.size(); ++i) {
    if (std::isfinite(s.parameters[i].lower)) {
      ceres_problem.SetParameterLowerBound(x.data(), static_cast<int>(i),
                                           s.parameters[i].lower / s.parameters[i].prior_scale);
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = calibrate_options.max_iterations;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  if (!summary.IsSolutionUsable()) {
    return refused("calibration of batch {}: the solver failed: {}", problem.batch.id, summary.message);
  }
  Minimum found{
      x, expand(problem, s, weights, robust, x), {}, summary.termination_type == ceres::CONVERGENCE, summary.message};
  for (const ceres::IterationSummary& step : summary.iterations) found.costs.push_back(step.cost);
  return found;
}

Result<Minimum> minimise(const CalibrationProblem& problem, const Scaled& s, const Weights& weights,
                         const CalibrateOptions& options, const Eigen::VectorXd& start) {
  if (std::optional<Minimum> found = full_steps(problem, s, weights, options, start)) return std::move(*found);
  return guarded_steps(problem, s, weights, options, start);
}

/// The residuals at `values`, SI: 3 x N positions, 3 x M rotations.
struct Residuals {
  Eigen::Matrix3Xd position;
  Eigen::Matrix3Xd rotation;
  Eigen::VectorXd sigma;  // N, of the measured positions
};

Residuals residuals_of(const PhysicalModel& model, const MeasurementBatch& batch, const Eigen::VectorXd& values) {
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  Residuals r{Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n), Eigen::VectorXd(n)};
  Eigen::Index turned = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    const Pose X_WT = model.pose_W(m.context, values, nullptr);
    r.position.col(i) = m.p_W - X_WT.translation();
    r.sigma(i) = position_sigma(m, *model.cell);
    if (m.R_WT) r.rotation.col(turned++) = rotation_log(*m.R_WT * X_WT.linear().transpose());
  }
  r.rotation.conservativeResize(3, turned);
  return r;
}

/// The surplus s with sum r^2 / (sigma_i^2 + s^2) = freedom (Paule and Mandel's between-laboratory variance); 0 when
/// the residuals are no larger than their sigmas say.
double surplus(const Eigen::Matrix3Xd& r, const Eigen::VectorXd& sigma, double freedom) {
  const auto chi2 = [&](double s) {
    double sum = 0;
    for (Eigen::Index i = 0; i < r.cols(); ++i) sum += r.col(i).squaredNorm() / (sigma(i) * sigma(i) + s * s);
    return sum;
  };
  if (r.cols() == 0 || freedom <= 0 || chi2(0) <= freedom) return 0;
  double low = 0;
  double high = std::sqrt(r.squaredNorm() / freedom) + 1e-15;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    (chi2(middle) > freedom ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double sigmas_of(const Residuals& r, Eigen::Index i, const Weights& weights) {
  return r.position.col(i).norm() / std::hypot(r.sigma(i), weights.discrepancy);
}

/// The positions that are no suspects; rotations stay.
Residuals without_suspects(const Residuals& r, const Weights& weights) {
  Residuals kept{r.position, r.rotation, r.sigma};
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) {
    if (sigmas_of(r, i, weights) > kSuspect) continue;
    kept.position.col(count) = r.position.col(i);
    kept.sigma(count++) = r.sigma(i);
  }
  kept.position.conservativeResize(3, count);
  kept.sigma.conservativeResize(count);
  return kept;
}

std::vector<SuspectPose> suspects_of(const MeasurementBatch& batch, const Residuals& r, const Weights& weights) {
  std::vector<SuspectPose> suspects;
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) {
    const double sigmas = sigmas_of(r, i, weights);
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    if (sigmas > kSuspect) suspects.push_back({m.pose_id, m.row, r.position.col(i).norm(), sigmas});
  }
  std::sort(suspects.begin(), suspects.end(), [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  return suspects;
}

double log_likelihood(const Residuals& r, const Weights& weights, double sigma_rotation) {
  double sum = 0;
  const auto add = [&](const auto& residual, double sigma, double discrepancy) {
    const double variance = sigma * sigma + discrepancy * discrepancy;
    // A suspect counts as far off, not as proof against the model.
    const double square = std::min(residual.squaredNorm() / variance, kSuspect * kSuspect);
    sum -= 0.5 * square + 1.5 * std::log(2 * kPi * variance);
  };
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) add(r.position.col(i), r.sigma(i), weights.discrepancy);
  for (Eigen::Index i = 0; i < r.rotation.cols(); ++i) {
    add(r.rotation.col(i), sigma_rotation, weights.discrepancy_rotation);
  }
  return sum;
}

/// How many parameters the data, not the priors, decide: the trace of N (N + 1)^-1.
double freedom_of(const Eigen::MatrixXd& information) {
  const Eigen::Index P = information.rows();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(P, P);
  return static_cast<double>(P) - (information + identity).llt().solve(identity).trace();
}

Information decomposed(const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  return {eigen.eigenvalues().cwiseMax(0).cwiseSqrt(), eigen.eigenvectors()};
}

/// Whether joints and positions can be of one robot at all: what identification leaves, `rms` (m), is no model's error
/// where it is a good part of the way that the tool went.
Status check_belongs(const MeasurementBatch& batch, double rms) {
  Vector3 mean = Vector3::Zero();
  for (const Measurement& m : batch.measurements) mean += m.p_W / static_cast<double>(batch.measurements.size());
  double square = 0;
  for (const Measurement& m : batch.measurements) square += (m.p_W - mean).squaredNorm();
  const double spread = std::sqrt(square / static_cast<double>(batch.measurements.size()));
  if (rms < std::max(kNoModelError, kNoModelShare * spread)) return {};
  return refused(
      "batch {}: {:.0f} mm rms are left after identification, of positions that spread over {:.0f} mm: these joints do "
      "not lead to these positions (look at the order of the joints, their signs and zeros, and which row belongs to "
      "which position)",
      batch.id, to_mm(rms), to_mm(spread));
}

Result<CalibrationResult> identify(const CalibrationProblem& problem, const CalibrateOptions& options) {
  const PhysicalModel& model = problem.model;
  const Tracker& tracker = model.cell->tracker;
  const Scaled s = scaled(model, options);
  const auto P = s.scale.size();
  CalibrationResult result;
  result.model = model;
  Weights weights;
  Minimum minimum;
  minimum.x = model.values.cwiseQuotient(s.scale);
  minimum.converged = P == 0;
  minimum.message = "nothing to identify";
  Residuals r;
  for (int round = 0; round < kMaxReweightings; ++round) {
    double freedom = 0;
    if (P > 0) {
      Result<Minimum> found = minimise(problem, s, weights, options, minimum.x);
      if (!found) return tl::make_unexpected(found.error());
      minimum = std::move(*found);
      result.iterations += static_cast<int>(minimum.costs.size());
      result.cost_record.insert(result.cost_record.end(), minimum.costs.begin(), minimum.costs.end());
      freedom = freedom_of(minimum.last.information);
    }
    r = residuals_of(model, problem.batch, minimum.x.cwiseProduct(s.scale));
    const double positions = 3.0 * static_cast<double>(r.position.cols());
    const double rotations = 3.0 * static_cast<double>(r.rotation.cols());
    const double share = std::max(0.0, 1 - freedom / (positions + rotations));
    const Weights before = weights;
    const Residuals trusted = is_robust(options, weights) ? without_suspects(r, weights) : r;
    weights.estimated = true;
    weights.discrepancy =
        surplus(trusted.position, trusted.sigma, 3.0 * static_cast<double>(trusted.position.cols()) * share);
    weights.discrepancy_rotation =
        surplus(r.rotation, Eigen::VectorXd::Constant(r.rotation.cols(), tracker.sigma_rotation), rotations * share);
    const auto settled = [](double sigma, double a, double b) {
      return std::abs(std::hypot(sigma, a) - std::hypot(sigma, b)) <= kSettledSigma * std::hypot(sigma, a);
    };
    if (before.estimated && settled(tracker.sigma, weights.discrepancy, before.discrepancy) &&
        settled(tracker.sigma_rotation, weights.discrepancy_rotation, before.discrepancy_rotation)) {
      break;
    }
  }
  result.model.values = minimum.x.cwiseProduct(s.scale);
  result.discrepancy = weights.discrepancy;
  result.discrepancy_rotation = weights.discrepancy_rotation;
  result.log_likelihood = log_likelihood(r, weights, tracker.sigma_rotation);
  result.suspects = suspects_of(problem.batch, r, weights);
  result.rms = std::sqrt(r.position.squaredNorm() / static_cast<double>(r.position.cols()));
  result.converged = minimum.converged;
  result.message = minimum.message;
  result.covariance = Eigen::MatrixXd::Zero(P, P);
  if (P == 0) return result;
  if (const Status belongs = check_belongs(problem.batch, result.rms); !belongs)
    return tl::make_unexpected(belongs.error());

  const Information seen = decomposed(minimum.last.information);
  const Eigen::VectorXd variance = (seen.singular_values.array().square() + 1).inverse();
  const Eigen::MatrixXd scaled_covariance = seen.directions * variance.asDiagonal() * seen.directions.transpose();
  result.covariance = s.scale.asDiagonal() * scaled_covariance * s.scale.asDiagonal();
  double least = std::numeric_limits<double>::infinity();
  double log_sum = 0;
  for (Eigen::Index k = 0; k < P; ++k) {
    const double value = seen.singular_values(k);
    if (value < 1) continue;
    ++result.rank;
    least = std::min(least, value);
    log_sum += std::log(value);
  }
  if (result.rank > 0) {
    result.observability_index =
        std::exp(log_sum / result.rank) / std::sqrt(static_cast<double>(problem.batch.measurements.size()));
  }
  result.unidentifiable = unidentifiable_combinations(seen, s.parameters, s.scale.cwiseQuotient(s.typical));
  result.condition_number = result.rank > 0 ? seen.singular_values(P - 1) / least : 0;
  for (Eigen::Index i = 0; i < P; ++i) {
    const Parameter& parameter = s.parameters[static_cast<std::size_t>(i)];
    const double stddev = std::sqrt(result.covariance(i, i));
    result.parameters.push_back({parameter, result.model.values(i), stddev, stddev < kIdentifiedShare * s.typical(i)});
  }
  return result;
}

/// Base and tool of the nominal chain refined together, and taken over as the model's frames.
Status find_frames(PhysicalModel& model, const MeasurementBatch& batch, const CalibrateOptions& options) {
  if (Status located = locate_unknown_frames(model, batch); !located) return located;
  std::vector<std::string> free;
  if (!model.cell->X_WB) free.emplace_back("base");
  if (has_unknown_tool(*model.cell)) free.emplace_back("tool");
  if (free.empty()) return {};
  Result<PhysicalModel> frames = make_physical_model(model.cell, free);
  if (!frames) return tl::make_unexpected(frames.error());
  frames->X_WB = model.X_WB;
  frames->tools = model.tools;
  const Result<CalibrationResult> refined = identify({*frames, batch}, options);
  if (!refined) return tl::make_unexpected(refined.error());
  for (auto& [tool, X_FT] : model.tools) {
    PoseContext anywhere;
    anywhere.q = JointVector::Zero(model.cell->robot.size());
    anywhere.tool = tool;
    const ArmState arm = refined->model.state(anywhere);
    X_FT = arm.X_FT;
    model.X_WB = arm.X_WB;
  }
  return {};
}

/// Every source must find what it needs in at least one pose.
Status check_context(const CalibrationProblem& problem) {
  const auto any = [&](auto has) {
    return std::any_of(problem.batch.measurements.begin(), problem.batch.measurements.end(),
                       [&](const Measurement& m) { return has(m.context); });
  };
  for (const ErrorSourcePtr& source : problem.model.sources) {
    const ContextNeeds needs = source->needs();
    const auto lacks = [&](const char* what) {
      return refused("batch {}: error source {} needs {}, which no pose has", problem.batch.id, source->name(), what);
    };
    if (needs.time && !any([](const PoseContext& c) { return c.time.has_value(); })) return lacks("a time (time_s)");
    if (needs.temperature && !any([](const PoseContext& c) { return c.temperature.has_value(); })) {
      return lacks("a temperature (temperature_c)");
    }
    const auto directed = [&](const PoseContext& c) {
      return !c.direction.empty() && c.direction[static_cast<std::size_t>(source->joint())] != 0;
    };
    if (needs.direction && !any(directed))
      return lacks(fmt::format("an approach direction (dir{})", source->joint() + 1).c_str());
    if (needs.velocity && !any([](const PoseContext& c) { return c.velocity.has_value(); })) {
      return lacks("a continuous path with times (time_s)");
    }
    const auto loaded = [&](const PoseContext& c) {
      const auto payload = problem.model.cell->payloads.find(c.payload);
      return payload != problem.model.cell->payloads.end() && payload->second.mass > 0;
    };
    if (needs.payload && !any(loaded)) return lacks("a payload with a mass");
  }
  return {};
}

/// The source that `name` means in the model (a cause stands for the form that is there), set back to its prior; added
/// where the model has none of it. Returns its full name.
Result<std::string> free_source(PhysicalModel& model, const std::string& name) {
  std::vector<std::string> names = alternatives(name, *model.cell);
  names.insert(names.begin(), name);
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (contains(names, source->name())) {
      for (Eigen::Index k = 0; k < count; ++k) {
        model.values(first + k) = source->parameters()[static_cast<std::size_t>(k)].prior;
      }
      return source->name();
    }
    first += count;
  }
  Result<ErrorSourcePtr> added = make_error_source(name, *model.cell);
  if (!added) return tl::make_unexpected(added.error());
  std::string full_name = (*added)->name();
  add_source(model, std::move(*added));
  return full_name;
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
  less.values = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  return less;
}

/// The order of `source` that explains most of the residuals through its joint's Jacobian column.
FoundOrder best_order(const ErrorSource& source, const PhysicalModel& model, const MeasurementBatch& batch,
                      const Residuals& r, const Weights& weights) {
  const auto n = r.position.cols();
  Eigen::VectorXd q(n);
  Eigen::VectorXd along(n);   // weighted residual along the column
  Eigen::VectorXd square(n);  // weighted square of the column
  for (Eigen::Index i = 0; i < n; ++i) {
    const PoseContext& context = batch.measurements[static_cast<std::size_t>(i)].context;
    const Pose X_FT = model.tools.at(context.tool);
    const Vector3 column =
        model.X_WB.linear() * model.cell->robot.jacobian(context.q, X_FT.translation()).col(source.joint()).head<3>();
    const double weight = 1 / (r.sigma(i) * r.sigma(i) + weights.discrepancy * weights.discrepancy);
    q(i) = context.q(source.joint());
    along(i) = weight * column.dot(r.position.col(i));
    square(i) = weight * column.squaredNorm();
  }
  return search_order(q, along, square, *source.search());
}

/// Sources to be searched are found one after the other, the strongest first, each on what the model found so far
/// leaves over; their values in the model become the start and the centre of the priors (amplitudes stay free).
Status search_orders(CalibrationProblem& problem, const CalibrateOptions& options) {
  PhysicalModel& model = problem.model;
  std::vector<std::size_t> open;
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    if (model.sources[k]->search()) open.push_back(k);
  }
  const std::vector<Eigen::Index> first = first_values(model);
  while (!open.empty()) {
    const Result<CalibrationResult> found = identify({without(model, open), problem.batch}, options);
    if (!found) return tl::make_unexpected(found.error());
    const Residuals r = residuals_of(found->model, problem.batch, found->model.values);
    const Weights weights{found->discrepancy, found->discrepancy_rotation, true};
    FoundOrder best;
    std::size_t strongest = open.front();
    for (const std::size_t k : open) {
      const FoundOrder candidate = best_order(*model.sources[k], found->model, problem.batch, r, weights);
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

}  // namespace

Result<CalibrationResult> calibrate(const CalibrationProblem& problem, const CalibrateOptions& options) {
  if (problem.batch.measurements.empty())
    return refused("batch {}: no measurements to calibrate with", problem.batch.id);
  CalibrationProblem complete = problem;
  if (const Cell& cell = *problem.model.cell; !cell.X_WB || has_unknown_tool(cell)) {
    if (Status found = find_frames(complete.model, complete.batch, options); !found) {
      return tl::make_unexpected(
          Error{found.error().code, fmt::format("batch {}: {}", problem.batch.id, found.error().message)});
    }
  }
  if (Status fit = check_context(complete); !fit) return tl::make_unexpected(fit.error());
  localise_base(complete.model, complete.batch);
  if (Status searched = search_orders(complete, options); !searched) return tl::make_unexpected(searched.error());
  return identify(complete, options);
}

Result<CalibrationResult> refit(const PhysicalModel& model, const MeasurementBatch& batch,
                                const std::vector<std::string>& only, CalibrateOptions options) {
  if (batch.measurements.empty()) return refused("batch {}: no measurements to calibrate with", batch.id);
  CalibrationProblem problem{model, batch};
  for (const std::string& name : only) {
    Result<std::string> source = free_source(problem.model, name);
    if (!source) return tl::make_unexpected(source.error());
    options.only.push_back(std::move(*source));
  }
  if (Status fit = check_context(problem); !fit) return tl::make_unexpected(fit.error());
  if (Status located = locate_unknown_frames(problem.model, batch); !located)
    return tl::make_unexpected(located.error());
  Result<CalibrationResult> result = identify(problem, options);
  if (!result) return result;
  // What is held is known: nothing is to be said of it.
  std::erase_if(result->unidentifiable, [&](const UnidentifiableCombination& combination) {
    return std::none_of(problem.model.sources.begin(), problem.model.sources.end(), [&](const ErrorSourcePtr& source) {
      const std::vector<Parameter>& own = source->parameters();
      return contains(options.only, source->name()) && std::any_of(own.begin(), own.end(), [&](const Parameter& p) {
               return p.name == combination.parameters.front();
             });
    });
  });
  return result;
}

Eigen::MatrixXd CalibrationResult::correlation() const {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& specs,
                                    const MeasurementBatch& batch, const CalibrateOptions& options) {
  std::vector<std::vector<std::string>> candidates = {{}};
  for (const std::string& spec : specs) {
    std::vector<std::vector<std::string>> longer;
    for (const auto& candidate : candidates) {
      for (const std::string& form : alternatives(spec, *cell)) {
        longer.push_back(candidate);
        longer.back().push_back(form);
      }
    }
    candidates = std::move(longer);
  }
  Result<CalibrationResult> best = tl::make_unexpected(Error{});
  std::map<std::string, std::string> found;  // sources that were searched for, with what the first form found
  for (std::vector<std::string>& candidate : candidates) {
    for (std::string& spec : candidate) {
      if (const auto order = found.find(spec); order != found.end()) spec = order->second;
    }
    Result<PhysicalModel> model = make_physical_model(cell, candidate);
    if (!model) return tl::make_unexpected(model.error());
    Result<CalibrationResult> result = calibrate({std::move(*model), batch}, options);
    if (!result) return result;
    const std::vector<Eigen::Index> first = first_values(result->model);
    for (std::size_t k = 0; k < result->model.sources.size(); ++k) {
      const ErrorSource& source = *result->model.sources[k];
      if (source.search()) {
        found[source.name()] = fmt::format("{}@{:.4f}", source.name(), result->model.values(first[k]));
      }
    }
    if (!best || result->log_likelihood > best->log_likelihood) best = std::move(result);
  }
  return best;
}

}  // namespace trammel
