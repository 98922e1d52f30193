#include "server/calibrate/identify/minimise.h"

#include <ceres/ceres.h>

#include <cmath>

#include "server/calibrate/identify/weighted_pose.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

class PoseCost final : public ceres::CostFunction {
 public:
  PoseCost(const WeightedPose& pose, Eigen::Index parameters) : pose_(pose) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(parameters));
    set_num_residuals(pose.size());
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    return pose_.evaluate(parameters[0], residuals, jacobians != nullptr ? jacobians[0] : nullptr);
  }

 private:
  WeightedPose pose_;
};

/// (x - prior) in prior units.
class PriorCost final : public ceres::CostFunction {
 public:
  explicit PriorCost(Eigen::VectorXd prior) : prior_(std::move(prior)) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(prior_.size()));
    set_num_residuals(static_cast<int>(prior_.size()));
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
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

/// By Levenberg-Marquardt, from any start.
Result<Minimum> guarded_steps(const CalibrationProblem& problem, const ScaledParameters& s,
                              const Weights& weights, const CalibrateOptions& calibrate_options,
                              Eigen::VectorXd x) {
  const bool robust = is_robust(calibrate_options, weights);
  ceres::Problem ceres_problem;
  for (std::size_t row = 0; row < problem.batch.measurements.size(); ++row) {
    const WeightedPose pose(problem.model, s, problem.batch.measurements[row], weights, row);
    ceres_problem.AddResidualBlock(new PoseCost(pose, s.scale.size()),
                                   robust ? new ceres::HuberLoss(pose.huber_limit()) : nullptr,
                                   x.data());
  }
  ceres_problem.AddResidualBlock(new PriorCost(s.prior), nullptr, x.data());
  const Eigen::VectorXd lower = s.lower();
  for (Eigen::Index i = 0; i < lower.size(); ++i) {
    if (std::isfinite(lower(i)))
      ceres_problem.SetParameterLowerBound(x.data(), static_cast<int>(i), lower(i));
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
    return refused("calibration of batch {}: the solver failed: {}", problem.batch.id,
                   summary.message);
  }
  Minimum found{x,
                expand(problem, s, weights, robust, x).information,
                {},
                summary.termination_type == ceres::CONVERGENCE,
                summary.message};
  for (const ceres::IterationSummary& step : summary.iterations) found.costs.push_back(step.cost);
  return found;
}

}  // namespace

Result<Minimum> minimise(const CalibrationProblem& problem, const ScaledParameters& s,
                         const Weights& weights, const CalibrateOptions& options,
                         const Eigen::VectorXd& start) {
  if (has_sessions(problem.batch)) return session_steps(problem, s, weights, options, start);
  if (std::optional<Minimum> found = full_steps(problem, s, weights, options, start))
    return std::move(*found);
  if (Result<Minimum> found = session_steps(problem, s, weights, options, start);
      found && found->converged)
    return found;
  return guarded_steps(problem, s, weights, options, start);
}

}  // namespace trammel
