#include "server/calibrate/calibrate.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/calibrate/localisation.h"

namespace trammel {

namespace {

constexpr int kMaxReweightings = 12;
constexpr double kIdentifiedShare = 0.5;  // of the prior's standard deviation, at most, is left of what was not known
constexpr double kUnknownWidening = 500;  // of the priors of an unknown base or tool: 1 m, 2.5 rad

/// Standard deviations with which residuals are weighed: the measurement's and, on top, the model's own.
struct Weights {
  double discrepancy = 0;           // m per axis
  double discrepancy_rotation = 0;  // rad per axis
};

double position_sigma(const Measurement& m, const Cell& cell) { return m.sigma.value_or(cell.tracker.sigma); }

bool has_unknown_tool(const Cell& cell) {
  return std::any_of(cell.tools.begin(), cell.tools.end(), [](const auto& tool) { return !tool.second; });
}

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
      out.topRows<3>().noalias() = -weight_ * J.topRows<3>() * scale_.asDiagonal();
      if (measurement_.R_WT) {
        // d log(R_m (exp(w) R)ᵀ) = -Jr^-1(turn) w to first order in w, Jr the right Jacobian of SO(3).
        out.bottomRows<3>().noalias() =
            -rotation_weight_ * right_jacobian_inverse(turn) * J.bottomRows<3>() * scale_.asDiagonal();
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

/// The priors stand around the model's values. Those of a frame that the cell calls unknown are wide: it was found with
/// a chain that was still wrong.
Scaled scaled(const PhysicalModel& model) {
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
      s.scale(k) = parameter.prior_scale;
      s.prior(k) = parameter.prior / parameter.prior_scale;
    }
  }
  return s;
}

ceres::Solver::Summary minimise(const CalibrationProblem& problem, const PhysicalModel& model, const Scaled& s,
                                const Weights& weights, int max_iterations, Eigen::VectorXd& x) {
  ceres::Problem ceres_problem;
  for (const Measurement& m : problem.batch.measurements) {
    ceres_problem.AddResidualBlock(new PoseCost(model, s.scale, m, weights), nullptr, x.data());
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
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  return summary;
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

double log_likelihood(const Residuals& r, const Weights& weights, double sigma_rotation) {
  double sum = 0;
  const auto add = [&](const auto& residual, double sigma, double discrepancy) {
    const double variance = sigma * sigma + discrepancy * discrepancy;
    sum -= 0.5 * residual.squaredNorm() / variance + 1.5 * std::log(2 * kPi * variance);
  };
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) add(r.position.col(i), r.sigma(i), weights.discrepancy);
  for (Eigen::Index i = 0; i < r.rotation.cols(); ++i) {
    add(r.rotation.col(i), sigma_rotation, weights.discrepancy_rotation);
  }
  return sum;
}

/// What the data say, in prior units: eigenvectors and singular values of the whitened Jacobian.
struct Information {
  Eigen::VectorXd singular_values;  // ascending
  Eigen::MatrixXd directions;       // columns
};

Information information(const PhysicalModel& model, const MeasurementBatch& batch, const Scaled& s,
                        const Weights& weights, const Eigen::VectorXd& x) {
  const auto P = s.scale.size();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(P, P);
  for (const Measurement& m : batch.measurements) {
    const PoseCost cost(model, s.scale, m, weights);
    Eigen::VectorXd r(cost.num_residuals());
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> J(cost.num_residuals(), P);
    const double* values = x.data();
    double* jacobian = J.data();
    cost.Evaluate(&values, r.data(), &jacobian);
    normal.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(normal.selfadjointView<Eigen::Lower>());
  return {eigen.eigenvalues().cwiseMax(0).cwiseSqrt(), eigen.eigenvectors()};
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

/// The null directions (columns, typical units) as few parameters at a time as they allow: Gaussian elimination with
/// complete pivoting, so that each new direction has a parameter of its own.
Eigen::MatrixXd disentangled(Eigen::MatrixXd directions) {
  for (Eigen::Index done = 0; done < directions.cols(); ++done) {
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    directions.rightCols(directions.cols() - done).cwiseAbs().maxCoeff(&row, &column);
    directions.col(done).swap(directions.col(done + column));
    directions.col(done) /= directions(row, done);
    for (Eigen::Index other = 0; other < directions.cols(); ++other) {
      if (other != done) directions.col(other) -= directions(row, other) * directions.col(done);
    }
  }
  return directions;
}

/// `direction` in typical units.
UnidentifiableCombination in_words(double singular_value, const Eigen::VectorXd& direction, const Scaled& s) {
  constexpr double kMatters = 0.1;  // of the largest part
  std::vector<std::size_t> order(s.parameters.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto weight = [&](std::size_t i) { return std::abs(direction(static_cast<Eigen::Index>(i))); };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return weight(a) > weight(b) + 1e-3; });
  UnidentifiableCombination combination;
  combination.singular_value = singular_value;
  for (const std::size_t i : order) {
    if (weight(i) >= kMatters * weight(order.front())) combination.parameters.push_back(s.parameters[i].name);
  }
  const std::string names = joined(combination.parameters);
  combination.sentence =
      combination.parameters.size() == 1
          ? fmt::format("{}: these poses do not show it; it stays at its prior", names)
          : fmt::format("{} move the tool the same way at these poses: only a combination of them is known", names);
  return combination;
}

/// Every direction that the data do not show (singular value below 1), told apart and in words.
std::vector<UnidentifiableCombination> unidentifiable_of(const Information& seen, const Scaled& s) {
  const auto unseen = (seen.singular_values.array() < 1).count();  // ascending: the first ones
  if (unseen == 0) return {};
  const Eigen::VectorXd to_typical = s.scale.cwiseQuotient(s.typical);
  const Eigen::MatrixXd directions = disentangled(to_typical.asDiagonal() * seen.directions.leftCols(unseen));
  std::vector<UnidentifiableCombination> combinations;
  for (Eigen::Index k = 0; k < unseen; ++k) {
    const Eigen::VectorXd in_prior_units = directions.col(k).cwiseQuotient(to_typical).normalized();
    const double value = (seen.singular_values.asDiagonal() * seen.directions.transpose() * in_prior_units).norm();
    combinations.push_back(in_words(value, directions.col(k), s));
  }
  return combinations;
}

/// Where the cell says `unknown`: base and tools in closed form from the nominal chain.
Status locate_unknown(PhysicalModel& model, const MeasurementBatch& batch) {
  const Cell& cell = *model.cell;
  bool base_known = cell.X_WB.has_value();
  for (const auto& [tool, known] : cell.tools) {
    std::vector<Pose> X_WT;
    std::vector<Pose> X_BF;
    std::vector<Pose> X_BF_full;
    std::vector<Vector3> points;
    for (const Measurement& m : batch.measurements) {
      if (m.context.tool != tool) continue;
      X_BF.push_back(cell.robot.flange_pose(m.context.q));
      points.push_back(m.p_W);
      if (m.R_WT) {
        X_BF_full.push_back(X_BF.back());
        X_WT.push_back(make_pose(*m.R_WT, m.p_W));
      }
    }
    if (points.empty() || (known && base_known)) continue;
    const Eigen::Matrix3Xd p_W =
        Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3, static_cast<Eigen::Index>(points.size()));
    const bool full = X_WT.size() >= 3 && 2 * X_WT.size() >= points.size();
    if (known) {  // base from this tool
      Eigen::Matrix3Xd p_B(3, p_W.cols());
      for (std::size_t i = 0; i < X_BF.size(); ++i) p_B.col(static_cast<int>(i)) = X_BF[i] * known->translation();
      const Result<Pose> X_WB = fit_transform(p_W, p_B);
      if (!X_WB) return tl::make_unexpected(X_WB.error());
      model.X_WB = *X_WB;
    } else if (base_known) {  // tool from this base
      std::vector<Pose> X_WF;
      for (const Pose& X : full ? X_BF_full : X_BF) X_WF.push_back(model.X_WB * X);
      if (full) {
        const Result<Pose> X_FT = locate_tool(X_WT, X_WF);
        if (!X_FT) return tl::make_unexpected(X_FT.error());
        model.tools[tool] = *X_FT;
      } else {
        const Result<Vector3> point = locate_tool_point(p_W, X_WF);
        if (!point) return tl::make_unexpected(point.error());
        model.tools[tool] = make_pose(Matrix3::Identity(), *point);
      }
    } else {
      Result<BaseAndTool> found = full ? locate_base_and_tool(X_WT, X_BF_full) : locate_base_and_tool_point(p_W, X_BF);
      if (full && !found) {  // too few axes of rotation for the orientations alone; the positions still tell the base
        found = locate_base_and_tool_point(p_W, X_BF);
        if (found) {
          std::vector<Pose> X_WF;
          for (const Pose& X : X_BF_full) X_WF.push_back(found->X_WB * X);
          found->X_FT.linear() = locate_tool(X_WT, X_WF)->linear();
        }
      }
      if (!found) return tl::make_unexpected(found.error());
      model.X_WB = found->X_WB;
      model.tools[tool] = found->X_FT;
    }
    base_known = true;
  }
  return {};
}

Result<CalibrationResult> identify(const CalibrationProblem& problem, const CalibrateOptions& options) {
  const PhysicalModel& model = problem.model;
  const Scaled s = scaled(model);
  const auto P = s.scale.size();
  CalibrationResult result;
  result.model = model;
  Eigen::VectorXd x = model.values.cwiseQuotient(s.scale);
  Weights weights;
  ceres::Solver::Summary summary;
  Residuals r;
  double rank = static_cast<double>(P);
  for (int round = 0; round < kMaxReweightings; ++round) {
    if (P > 0) {
      summary = minimise(problem, model, s, weights, options.max_iterations, x);
      result.iterations += static_cast<int>(summary.iterations.size());
      if (!summary.IsSolutionUsable()) {
        return refused("calibration of batch {}: the solver failed: {}", problem.batch.id, summary.message);
      }
      const Information seen = information(model, problem.batch, s, weights, x);
      rank = static_cast<double>((seen.singular_values.array() >= 1).count());
    }
    r = residuals_of(model, problem.batch, x.cwiseProduct(s.scale));
    const double positions = 3.0 * static_cast<double>(r.position.cols());
    const double rotations = 3.0 * static_cast<double>(r.rotation.cols());
    const double share = std::max(0.0, 1 - rank / (positions + rotations));
    const Weights before = weights;
    weights.discrepancy = surplus(r.position, r.sigma, positions * share);
    weights.discrepancy_rotation =
        surplus(r.rotation, Eigen::VectorXd::Constant(r.rotation.cols(), model.cell->tracker.sigma_rotation),
                rotations * share);
    const auto settled = [](double a, double b, double floor) { return std::abs(a - b) <= 0.01 * std::max(a, floor); };
    if (settled(weights.discrepancy, before.discrepancy, model.cell->tracker.sigma) &&
        settled(weights.discrepancy_rotation, before.discrepancy_rotation, model.cell->tracker.sigma_rotation)) {
      break;
    }
  }
  result.model.values = x.cwiseProduct(s.scale);
  result.discrepancy = weights.discrepancy;
  result.discrepancy_rotation = weights.discrepancy_rotation;
  result.log_likelihood = log_likelihood(r, weights, model.cell->tracker.sigma_rotation);
  result.rms = std::sqrt(r.position.squaredNorm() / static_cast<double>(r.position.cols()));
  result.converged = P == 0 || summary.termination_type == ceres::CONVERGENCE;
  result.message = P == 0 ? "nothing to identify" : summary.message;
  result.covariance = Eigen::MatrixXd::Zero(P, P);
  if (P == 0) return result;

  const Information seen = information(model, problem.batch, s, weights, x);
  const Eigen::VectorXd variance = (seen.singular_values.array().square() + 1).inverse();
  const Eigen::MatrixXd scaled_covariance = seen.directions * variance.asDiagonal() * seen.directions.transpose();
  result.covariance = s.scale.asDiagonal() * scaled_covariance * s.scale.asDiagonal();
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < P; ++k) {
    const double value = seen.singular_values(k);
    if (value < 1) continue;
    ++result.rank;
    least = std::min(least, value);
  }
  result.unidentifiable = unidentifiable_of(seen, s);
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
  if (Status located = locate_unknown(model, batch); !located) return located;
  std::vector<std::string> free;
  if (!model.cell->X_WB) free.emplace_back("base");
  if (has_unknown_tool(*model.cell) && model.cell->tools.size() == 1) {
    free.emplace_back("tool");
  }
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

/// A known base to be corrected starts, and has its prior, where SVD localisation of the nominal chain puts it, eqs.
/// (3.8)-(3.10).
void localise_base(PhysicalModel& model, const MeasurementBatch& batch) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->name() == "base") break;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  if (first == model.values.size()) return;
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  Eigen::Matrix3Xd measured(3, n);
  Eigen::Matrix3Xd nominal(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    measured.col(i) = model.X_WB.inverse() * m.p_W;
    nominal.col(i) = model.X_WB.inverse() * model.nominal_pose_W(m.context).translation();
  }
  const Result<Pose> X_BB = fit_transform(measured, nominal);
  if (!X_BB) return;  // too few points to localise: the nominal base is the start
  const Vector3 zyx = X_BB->linear().eulerAngles(2, 1, 0);
  const bool flipped = std::abs(zyx(1)) > kPi / 2;  // the other triple of the same rotation
  model.values.segment<3>(first) = X_BB->translation();
  model.values.segment<3>(first + 3) =
      flipped ? Vector3(zyx(0) - std::copysign(kPi, zyx(0)), std::copysign(kPi, zyx(1)) - zyx(1),
                        zyx(2) - std::copysign(kPi, zyx(2)))
              : zyx;
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
  localise_base(complete.model, complete.batch);
  return identify(complete, options);
}

Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& specs,
                                    const MeasurementBatch& batch, const CalibrateOptions& options) {
  std::vector<std::vector<std::string>> candidates = {{}};
  for (const std::string& spec : specs) {
    std::vector<std::vector<std::string>> longer;
    for (const auto& candidate : candidates) {
      for (const std::string& form : alternatives(spec)) {
        longer.push_back(candidate);
        longer.back().push_back(form);
      }
    }
    candidates = std::move(longer);
  }
  Result<CalibrationResult> best = tl::make_unexpected(Error{});
  for (const auto& candidate : candidates) {
    Result<PhysicalModel> model = make_physical_model(cell, candidate);
    if (!model) return tl::make_unexpected(model.error());
    Result<CalibrationResult> result = calibrate({std::move(*model), batch}, options);
    if (!result) return result;
    if (!best || result->log_likelihood > best->log_likelihood) best = std::move(result);
  }
  return best;
}

}  // namespace trammel
