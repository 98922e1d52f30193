#include "server/diagnose/triage/batch_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "server/base/median.h"
#include "server/diagnose/thresholds.h"
#include "server/robot/rigid_fit.h"

namespace trammel::batch_triage {

namespace {

constexpr int kMostIterations = 30;
constexpr double kDone = 1e-4;  // last step, in units of the parameters' own scales
constexpr double kFarthest =
    9;  // times the median of |residual|^2: annealing towards the final limit
constexpr double kGoodMisfit =
    2.25;  // chi^2 per degree of freedom: 1.5 times the expected deviation is still good
constexpr double kWeakPrior =
    1e-8;  // of the free parameters' information, per squared scale of the parameter

/// The number of directions of the free parameters that the poses determine better than the prior.
int shown_directions(const Alternative& alternative, const Eigen::MatrixXd& information) {
  std::vector<Eigen::Index> free;
  for (std::size_t k = 0; k < alternative.free.size(); ++k) {
    if (alternative.free[k] || alternative.base[k]) free.push_back(static_cast<Eigen::Index>(k));
  }
  if (free.empty()) return 0;
  const Eigen::MatrixXd own = information(free, free);
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(own, Eigen::EigenvaluesOnly).eigenvalues();
  return static_cast<int>((eigenvalues.array() > 1).count());
}

}  // namespace

Comparison::Comparison(const CompensatedModel& model, const MeasurementBatch& batch)
    : model_(model),
      batch_(batch),
      rotation_bias_B_(batch.measurements.size(), Matrix3::Identity()),
      is_turned_(batch.measurements.size(), false) {
  const CompensatedModel::LevelErrors errors = model.errors_B(batch);
  bias_B_ = errors.calibrated - errors.compensated;
  deviation_.setOnes(6, poses());
  deviation_.topRows<3>() = errors.stddev;
  const double expected = std::sqrt(errors.stddev.squaredNorm() / static_cast<double>(poses()));
  if (const auto& held_out = model.parts().validation) {
    deviation_.topRows<3>() *= std::max(1.0, held_out->compensated.rms / expected);
  }
  expect_rotations(errors.rotation);
  for (const Measurement& m : batch.measurements) contexts_.push_back(as_served(m));
}

void Comparison::expect_rotations(const CompensatedModel::LevelErrors::Rotations& errors) {
  const auto& training = model_.parts().training.orientation;
  const auto& held_out =
      model_.parts().validation ? model_.parts().validation->orientation : std::nullopt;
  if (!training || errors.calibrated.cols() == 0) return;
  const double shown = std::max(training->compensated, held_out ? held_out->compensated : 0);
  Eigen::Matrix3Xd stddev = errors.stddev;
  if (stddev.cols() == 0)
    stddev.setConstant(3, errors.calibrated.cols(), model_.cell().tracker.sigma_rotation);
  stddev *=
      std::max(1.0, shown / std::sqrt(stddev.squaredNorm() / static_cast<double>(stddev.cols())));
  Eigen::Index next = 0;
  for (int i = 0; i < poses(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!batch_.measurements[at].R_WT) continue;
    is_turned_[at] = true;
    deviation_.col(i).tail<3>() = stddev.col(next);
    rotation_bias_B_[at] = rotation_exp(errors.compensated.col(next)).transpose() *
                           rotation_exp(errors.calibrated.col(next));
    ++next;
  }
}

double Comparison::all_rows() const {
  return 3.0 * poses() +
         3.0 * static_cast<double>(std::count(is_turned_.begin(), is_turned_.end(), true));
}

void Comparison::residual(const Alternative& alternative, const Eigen::VectorXd& values, int pose,
                          Eigen::VectorXd& r, Eigen::MatrixXd& jacobian) const {
  Eigen::VectorXd here = values;
  const bool begun = pose >= alternative.first;
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) here(k) = alternative.known(k);
  }
  const Pose X_WT =
      alternative.model.pose_W(contexts_[static_cast<std::size_t>(pose)], here, &jacobian);
  const Matrix3 R_BW = alternative.model.X_WB.linear().transpose();
  const Measurement& m = batch_.measurements[static_cast<std::size_t>(pose)];
  r.resize(rows(pose));
  r.head<3>() = R_BW * (m.p_W - X_WT.translation()) - bias_B_.col(pose);
  jacobian.topRows<3>() = (R_BW * jacobian.topRows<3>()).eval();
  if (rows(pose) == 6) {
    const Matrix3 R_BT = rotation_bias_B_[static_cast<std::size_t>(pose)] * (R_BW * X_WT.linear());
    r.tail<3>() = rotation_log(R_BW * *m.R_WT * R_BT.transpose());
    jacobian.bottomRows<3>() = (R_BW * jacobian.bottomRows<3>()).eval();
  } else {
    jacobian.conservativeResize(3, Eigen::NoChange);
  }
  for (Eigen::Index k = 0; !begun && k < here.size(); ++k) {
    if (alternative.free[static_cast<std::size_t>(k)]) jacobian.col(k).setZero();
  }
}

/// The prior precision of all parameters in units of their scales. The model's own parameters keep
/// the precision after calibration. The freed parameters have almost none.
Eigen::MatrixXd Comparison::prior_precision(const Alternative& alternative,
                                            const Eigen::VectorXd& scale) const {
  constexpr double kRounding = 1e-10;  // a covariance may be singular, for exactly known directions
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
  const Eigen::MatrixXd known =
      covariance.llt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
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
  Eigen::VectorXd scale, values;          ///< of the parameters, SI
  Eigen::MatrixXd prior;                  ///< precision, in units of scale
  std::vector<Eigen::VectorXd> residual;  ///< of each pose, m and rad
  std::vector<Eigen::MatrixXd>
      rows;                    ///< P columns: derivative over expected deviation, in units of scale
  std::vector<double> square;  ///< |residual over expected deviation|^2
  Eigen::MatrixXd information;  ///< of the poses that count as inliers
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
  fitting.residual.resize(static_cast<std::size_t>(poses()));
  fitting.rows.resize(static_cast<std::size_t>(poses()));
  fitting.square.resize(static_cast<std::size_t>(poses()));
  return fitting;
}

void Comparison::linearise(const Alternative& alternative, Fitting& fitting) const {
  Eigen::MatrixXd jacobian;
  for (int i = 0; i < poses(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    Eigen::VectorXd& r = fitting.residual[at];
    residual(alternative, fitting.values, i, r, jacobian);
    const Eigen::VectorXd weight = deviation_.col(i).head(rows(i)).cwiseInverse();
    fitting.rows[at] = weight.asDiagonal() * jacobian * fitting.scale.asDiagonal();
    fitting.square[at] = r.cwiseProduct(weight).squaredNorm();
  }
}

/// The next step in units of scale, from the poses that are not farther off than `farthest`.
Eigen::VectorXd Comparison::step(const Alternative& alternative, double farthest,
                                 Fitting& fitting) const {
  const Eigen::VectorXd off = (fitting.values - alternative.known).cwiseQuotient(fitting.scale);
  Eigen::VectorXd gradient = -fitting.prior * off;
  Eigen::MatrixXd counted(off.size(),
                          static_cast<Eigen::Index>(all_rows()));  // one column a row that counts
  Eigen::Index filled = 0;
  for (int i = 0; i < poses(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (fitting.square[at] > farthest) continue;
    counted.middleCols(filled, rows(i)) = fitting.rows[at].transpose();
    filled += rows(i);
    gradient.noalias() += fitting.rows[at].transpose() *
                          fitting.residual[at].cwiseQuotient(deviation_.col(i).head(rows(i)));
  }
  fitting.information.setZero(off.size(), off.size());
  if (filled > 0)
    fitting.information.selfadjointView<Eigen::Lower>().rankUpdate(counted.leftCols(filled));
  fitting.information = Eigen::MatrixXd(fitting.information.selfadjointView<Eigen::Lower>());
  return (fitting.information + fitting.prior).llt().solve(gradient);
}

Fit Comparison::judged(const Alternative& alternative, const Fitting& fitting) const {
  const int n = poses();
  const Eigen::VectorXd off = (fitting.values - alternative.known).cwiseQuotient(fitting.scale);
  Fit fit;
  fit.residual.resize(3, n);
  fit.turn.setZero(3, n);
  double inside = 0;
  double all = 0;
  double judged_rows = 0;
  double bad = 0;
  for (int i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double cost = fitting.square[at];
    fit.residual.col(i) = fitting.residual[at].head<3>();
    if (rows(i) == 6) fit.turn.col(i) = fitting.residual[at].tail<3>();
    all += cost;
    if (cost > limit(rows(i))) {
      fit.outliers.push_back(i);
      bad += limit(rows(i));
    } else {
      inside += cost;
      judged_rows += static_cast<double>(rows(i));
    }
  }
  const auto outliers = static_cast<double>(fit.outliers.size());
  const int k = shown_directions(alternative, fitting.information);
  const int places = alternative.first > 0 ? 2 : 0;  // the first pose was chosen, which has a price
  fit.score =
      inside + bad + off.dot(fitting.prior * off) + k * std::log(all_rows()) + places * std::log(n);
  const double freedom = judged_rows - k;
  fit.misfit = freedom > 0 ? inside / freedom : inside;
  fit.misfit_all = all / std::max(all_rows() - k, 1.0);
  fit.explains =
      freedom > 0 && fit.misfit <= kGoodMisfit &&
      outliers <= std::max<double>(kFewOutliers, cause_search::thresholds::kMostOutliers * n);
  return fit;
}

Fit Comparison::fit(const Alternative& alternative) const {
  Fitting fitting = begun(alternative);
  for (int iteration = 0;; ++iteration) {
    linearise(alternative, fitting);
    // First uses all poses, so that the fit follows the change; then only those that are not much
    // farther off than others.
    const auto changed = fitting.square.begin() + alternative.first;
    const double farthest =
        iteration == 0 ? std::numeric_limits<double>::infinity()
                       : std::max(limit(6), kFarthest * median({changed, fitting.square.end()}));
    const Eigen::VectorXd next = step(alternative, farthest, fitting);
    if (iteration >= kMostIterations || !(next.norm() > kDone)) return judged(alternative, fitting);
    fitting.values += next.cwiseProduct(fitting.scale);
  }
}

}  // namespace trammel::batch_triage
