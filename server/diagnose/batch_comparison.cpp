#include "server/diagnose/batch_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "server/robot/rigid_fit.h"

namespace trammel::batch_triage {

namespace {

constexpr int kMostIterations = 30;
constexpr double kDone = 1e-4;         // last step, in units of the parameters' own scales
constexpr double kFarthest = 9;        // times the median of |residual|^2: annealing towards the final limit
constexpr double kGoodMisfit = 2.25;   // chi^2 per degree of freedom: 1.5 times the expected deviation is still good
constexpr double kMostOutliers = 0.1;  // of the poses
constexpr double kWeakPrior = 1e-8;    // of what an alternative sets free, per squared scale of the parameter

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Directions of the free parameters that the poses show: more of them than the prior does.
int shown_directions(const Alternative& alternative, const Eigen::MatrixXd& information) {
  std::vector<Eigen::Index> free;
  for (std::size_t k = 0; k < alternative.free.size(); ++k) {
    if (alternative.free[k] || alternative.base[k]) free.push_back(static_cast<Eigen::Index>(k));
  }
  if (free.empty()) return 0;
  const Eigen::MatrixXd own = information(free, free);
  const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(own).eigenvalues();
  return static_cast<int>((eigenvalues.array() > 1).count());
}

}  // namespace

void Comparison::residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose, Vector3& r,
                          Eigen::MatrixXd& jacobian) const {
  Eigen::VectorXd here = values;
  const bool begun = pose >= alternative.first;
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) here(k) = alternative.known(k);
  }
  const Pose X_WT = alternative.model.pose_W(contexts_[static_cast<std::size_t>(pose)], here, &jacobian);
  const Matrix3 R_BW = alternative.model.X_WB.linear().transpose();
  r = R_BW * (batch_.measurements[static_cast<std::size_t>(pose)].p_W - X_WT.translation()) - bias_B_.col(pose);
  jacobian = (R_BW * jacobian.topRows<3>()).eval();
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) jacobian.col(k).setZero();
  }
}

/// Of all parameters in units of their scales: the model's own as calibration left them, those set free hardly any.
Eigen::MatrixXd Comparison::prior_precision(const Alternative& alternative, const Eigen::VectorXd& scale) const {
  constexpr double kRounding = 1e-10;  // a covariance may be flat: what is known for certain
  const Eigen::Index p = scale.size();
  std::vector<Eigen::Index> held, held_in_model;
  std::map<std::string, Eigen::Index> place;  // of the calibrated model's parameters
  const std::vector<Parameter> own = model_.parts().physics.parameters();
  for (std::size_t k = 0; k < own.size(); ++k) place[own[k].name] = static_cast<Eigen::Index>(k);
  const std::vector<Parameter> all = alternative.model.parameters();
  for (Eigen::Index k = 0; k < p; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const auto found = place.find(all[at].name);
    if (alternative.free[at] || alternative.base[at] || found == place.end()) continue;
    held.push_back(k);
    held_in_model.push_back(found->second);
  }
  Eigen::MatrixXd precision = kWeakPrior * Eigen::MatrixXd::Identity(p, p);
  if (held.empty()) return precision;
  Eigen::MatrixXd covariance = model_.parts().covariance(held_in_model, held_in_model);
  const Eigen::VectorXd inverse = scale(held).cwiseInverse();
  covariance = inverse.asDiagonal() * covariance * inverse.asDiagonal();
  covariance.diagonal().array() += kRounding;
  const Eigen::MatrixXd known = covariance.llt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  precision(held, held) = known;
  return precision;
}

Pose Comparison::located_base(const PhysicalModel& model) const {
  Eigen::Matrix3Xd measured_W(3, poses()), predicted_B(3, poses());
  for (int i = 0; i < poses(); ++i) {
    measured_W.col(i) = batch_.measurements[static_cast<std::size_t>(i)].p_W;
    const Pose X_WT = model.pose_W(contexts_[static_cast<std::size_t>(i)]);
    predicted_B.col(i) = model.X_WB.inverse() * X_WT.translation() + bias_B_.col(i);
  }
  return fit_transform(measured_W, predicted_B).value_or(model.X_WB);
}

/// One alternative being fitted.
struct Fitting {
  Eigen::VectorXd scale, values;      ///< of the parameters, SI
  Eigen::MatrixXd prior;              ///< precision, in units of scale
  Eigen::Matrix3Xd residual;          ///< m
  std::vector<Eigen::MatrixXd> rows;  ///< 3 x P a pose: derivative over expected deviation, in units of scale
  std::vector<double> square;         ///< |residual over expected deviation|^2
  Eigen::MatrixXd information;        ///< of the poses that count
};

Fitting Comparison::begun(const Alternative& alternative) const {
  const std::vector<Parameter> parameters = alternative.model.parameters();
  Fitting fitting;
  fitting.scale.resize(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    fitting.scale(static_cast<Eigen::Index>(k)) = parameters[k].prior_scale;
  }
  fitting.values = alternative.known;
  fitting.prior = prior_precision(alternative, fitting.scale);
  fitting.residual.resize(3, poses());
  fitting.rows.resize(static_cast<std::size_t>(poses()));
  fitting.square.resize(static_cast<std::size_t>(poses()));
  return fitting;
}

void Comparison::linearise(const Alternative& alternative, Fitting& fitting) const {
  Eigen::MatrixXd jacobian;
  for (int i = 0; i < poses(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    Vector3 r;
    residual(alternative, fitting.values, i, r, jacobian);
    fitting.residual.col(i) = r;
    fitting.rows[at] = deviation_.col(i).cwiseInverse().asDiagonal() * jacobian * fitting.scale.asDiagonal();
    fitting.square[at] = r.cwiseQuotient(deviation_.col(i)).squaredNorm();
  }
}

/// The next step in units of scale, from the poses that are not farther off than `farthest`.
Eigen::VectorXd Comparison::step(const Alternative& alternative, double farthest, Fitting& fitting) const {
  const Eigen::VectorXd off = (fitting.values - alternative.known).cwiseQuotient(fitting.scale);
  Eigen::VectorXd gradient = -fitting.prior * off;
  fitting.information.setZero(off.size(), off.size());
  for (int i = 0; i < poses(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (fitting.square[at] > farthest) continue;
    fitting.information.noalias() += fitting.rows[at].transpose() * fitting.rows[at];
    gradient.noalias() += fitting.rows[at].transpose() * fitting.residual.col(i).cwiseQuotient(deviation_.col(i));
  }
  return (fitting.information + fitting.prior).ldlt().solve(gradient);
}

Fit Comparison::judged(const Alternative& alternative, const Fitting& fitting) const {
  const int n = poses();
  const Eigen::VectorXd off = (fitting.values - alternative.known).cwiseQuotient(fitting.scale);
  Fit fit;
  fit.residual = fitting.residual;
  double inside = 0;
  double all = 0;
  for (int i = 0; i < n; ++i) {
    const double cost = fitting.square[static_cast<std::size_t>(i)];
    all += cost;
    if (cost > limit()) {
      fit.outliers.push_back(i);
    } else {
      inside += cost;
    }
  }
  const auto outliers = static_cast<double>(fit.outliers.size());
  const int k = shown_directions(alternative, fitting.information);
  const int places = alternative.first > 0 ? 2 : 0;  // where it begins was chosen
  fit.score = inside + limit() * outliers + off.dot(fitting.prior * off) + k * std::log(3.0 * n) + places * std::log(n);
  const double freedom = 3 * (n - outliers) - k;
  fit.misfit = freedom > 0 ? inside / freedom : inside;
  fit.misfit_all = all / std::max(3 * n - k, 1);
  fit.explains =
      freedom > 0 && fit.misfit <= kGoodMisfit && outliers <= std::max<double>(kFewOutliers, kMostOutliers * n);
  return fit;
}

Fit Comparison::fit(const Alternative& alternative) const {
  Fitting fitting = begun(alternative);
  for (int iteration = 0;; ++iteration) {
    linearise(alternative, fitting);
    // First all poses, so that what has begun is followed; then only those that are not much farther off than others.
    const auto changed = fitting.square.begin() + alternative.first;
    const double farthest = iteration == 0 ? std::numeric_limits<double>::infinity()
                                           : std::max(limit(), kFarthest * median({changed, fitting.square.end()}));
    const Eigen::VectorXd next = step(alternative, farthest, fitting);
    if (iteration >= kMostIterations || !(next.norm() > kDone)) return judged(alternative, fitting);
    fitting.values += next.cwiseProduct(fitting.scale);
  }
}

}  // namespace trammel::batch_triage
