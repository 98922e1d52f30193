#include "server/health/evidence/check_rows.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "server/base/median.h"
#include "server/robot/rigid_fit.h"

namespace trammel::health {

namespace {

using Eigen::Index;

constexpr double kShared =
    0.2;  // of a joint's range: poses nearer than that share their model error
constexpr double kOfJoints = 0.5;  // share of the model-error variance that acts as errors of
                                   // joints; the rest acts in any direction
constexpr double kFarOff = 6;      // times the median: such a pose does not help to locate the base
constexpr int kLocalisations = 4;  // each without the poses that were far off the last time
constexpr double kThin = 0.02;  // relative to the distance of the poses: if they are this close to
                                // a line, they do not determine the turn about it
constexpr double kJitter = 1e-6;  // of the instrument's variance: keeps exact values positive
                                  // definite under rounding
constexpr double kUnmoved =
    0.02;  // relative to the distance of the poses: a zero of a degree moves them no farther
constexpr double kTurned = 0.002;  // rad: uncertainty of an assumed turn of the base

/// The base that fits the positions, without positions much farther off than the others.
Result<Pose> located(const MeasurementBatch& batch,
                     const std::vector<ErrorPrediction>& predictions) {
  const std::size_t n = predictions.size();
  std::vector<std::size_t> used(n);
  for (std::size_t i = 0; i < n; ++i) used[i] = i;
  Result<Pose> X_WB = failure(ErrorCode::kRefused, "no poses");
  for (int round = 0; round < kLocalisations; ++round) {
    Eigen::Matrix3Xd measured_W(3, static_cast<Index>(used.size())), predicted_B = measured_W;
    for (std::size_t k = 0; k < used.size(); ++k) {
      measured_W.col(static_cast<Index>(k)) = batch.measurements[used[k]].p_W;
      predicted_B.col(static_cast<Index>(k)) = predictions[used[k]].X_BT_predicted.translation();
    }
    Result<Pose> next = fit_transform(measured_W, predicted_B);
    if (!next) return round == 0 ? next : X_WB;
    X_WB = std::move(next);
    std::vector<double> off;
    for (std::size_t i = 0; i < n; ++i)
      off.push_back((X_WB->inverse() * batch.measurements[i].p_W -
                     predictions[i].X_BT_predicted.translation())
                        .norm());
    const double far_off = kFarOff * median(off);
    used.clear();
    for (std::size_t i = 0; i < n; ++i)
      if (off[i] <= far_off) used.push_back(i);
    if (used.size() == n) break;
  }
  return X_WB;
}

/// True if the tool met one point in all poses, which is the origin of their frame
/// (about_one_point()).
bool are_contacts(const MeasurementBatch& batch) {
  return std::all_of(batch.measurements.begin(), batch.measurements.end(),
                     [](const Measurement& m) { return m.p_W.isZero(0) && !m.R_WT; });
}

/// The base with the turn of the model, the point that the tool met at the median of the predicted
/// places, so that few lost contacts do not move it. The turn of the base changes nothing of such
/// poses.
Pose about_the_point(const std::vector<ErrorPrediction>& predictions, const Matrix3& R_WB) {
  Vector3 met_B;
  for (Index k = 0; k < 3; ++k) {
    std::vector<double> along;
    for (const ErrorPrediction& one : predictions)
      along.push_back(one.X_BT_predicted.translation()(k));
    met_B(k) = median(std::move(along));
  }
  return make_pose(R_WB, -(R_WB * met_B));
}

/// True if all poses lie near one place or on one line. Then any error of the poses turns the base.
bool are_thin(const std::vector<ErrorPrediction>& predictions) {
  Eigen::Matrix3Xd p_B(3, static_cast<Index>(predictions.size()));
  for (std::size_t i = 0; i < predictions.size(); ++i)
    p_B.col(static_cast<Index>(i)) = predictions[i].X_BT_predicted.translation();
  const Vector3 mean = p_B.rowwise().mean();
  const Eigen::Matrix3Xd apart = p_B.colwise() - mean;
  const double across = Eigen::JacobiSVD<Eigen::Matrix3Xd>(apart).singularValues()(1);
  return across < kThin * mean.norm() * std::sqrt(static_cast<double>(predictions.size()));
}

/// The base by the orientations, and by the mean of the positions.
Pose turned_by_orientations(const MeasurementBatch& batch,
                            const std::vector<ErrorPrediction>& predictions) {
  Matrix3 turned = Matrix3::Zero();
  Vector3 measured_W = Vector3::Zero(), predicted_B = Vector3::Zero();
  const auto n = static_cast<double>(predictions.size());
  for (std::size_t i = 0; i < predictions.size(); ++i) {
    const Pose& X_BT = predictions[i].X_BT_predicted;
    if (batch.measurements[i].R_WT)
      turned += *batch.measurements[i].R_WT * X_BT.linear().transpose();
    measured_W += batch.measurements[i].p_W / n;
    predicted_B += X_BT.translation() / n;
  }
  const Matrix3 R_WB = nearest_rotation(turned);
  return make_pose(R_WB, measured_W - R_WB * predicted_B);
}

/// The base with the turn of `X_WB`, by the mean of the positions; empty: it stands elsewhere.
std::optional<Pose> turned_as_before(const MeasurementBatch& batch,
                                     const std::vector<ErrorPrediction>& predictions,
                                     const Pose& X_WB) {
  Vector3 shift_W = Vector3::Zero();
  double away = 0;
  const auto n = static_cast<double>(predictions.size());
  for (std::size_t i = 0; i < predictions.size(); ++i) {
    const Vector3& p_B = predictions[i].X_BT_predicted.translation();
    shift_W += (batch.measurements[i].p_W - X_WB * p_B) / n;
    away += p_B.norm() / n;
  }
  if (shift_W.norm() > kUnmoved * away) return std::nullopt;
  return make_pose(X_WB.linear(), X_WB.translation() + shift_W);
}

struct Stand {
  Pose X_WB;
  bool turns = true;  ///< otherwise the base is turned as in the model
};

Result<Stand> base_of(const MeasurementBatch& batch,
                      const std::vector<ErrorPrediction>& predictions, bool by_orientations,
                      const Pose& X_WB_of_model) {
  constexpr std::size_t kFewest = 3;  // poses
  if (are_contacts(batch) && predictions.size() >= kFewest)
    return Stand{about_the_point(predictions, X_WB_of_model.linear()), false};
  if (predictions.size() < kFewest || !are_thin(predictions))
    return located(batch, predictions).map([](const Pose& X_WB) { return Stand{X_WB}; });
  if (by_orientations) return Stand{turned_by_orientations(batch, predictions)};
  if (const auto X_WB = turned_as_before(batch, predictions, X_WB_of_model))
    return Stand{*X_WB, false};
  return refused(
      "all of them are at about one place or on one line, so that any error turns the base, and "
      "the instrument stands elsewhere than in the model: measure poses that are spread over the "
      "workspace (`trammel plan --check`)");
}

/// Limits the turn of the base to kTurned, about the mean of the measured positions; its place is
/// refitted.
void hold_turn(CheckRows& rows) {
  const auto measured_B = [&](std::size_t i) {
    return Vector3(rows.predicted[i].translation() + rows.residual.segment<3>(rows.first[i]));
  };
  Vector3 mean = Vector3::Zero();
  for (std::size_t i = 0; i < rows.poses(); ++i)
    mean += measured_B(i) / static_cast<double>(rows.poses());
  Eigen::MatrixXd by_turn(rows.residual.size(), 3);
  for (std::size_t i = 0; i < rows.poses(); ++i)
    by_turn.middleRows<3>(rows.first[i]) = -skew(measured_B(i) - mean);
  rows.covariance += kTurned * kTurned * by_turn * by_turn.transpose();
  rows.by_base = Eigen::MatrixXd(rows.by_base.leftCols<3>());
}

/// Standard deviation of one axis of an orientation that the model shows on its own poses; 0: it
/// knows none.
double rotation_shown(const ModelParts& parts) {
  if (!parts.training.orientation) return 0;
  const auto& held_out = parts.validation ? parts.validation->orientation : std::nullopt;
  return std::max(parts.training.orientation->compensated, held_out ? held_out->compensated : 0) /
         std::sqrt(3.0);
}

/// The correlation of the model errors of two poses.
double shared(const PoseContext& one, const PoseContext& other, const JointVector& range) {
  double square = 0;
  for (Index j = 0; j < range.size(); ++j) {
    const double apart = (one.q(j) - other.q(j)) / std::max(kShared * range(j), 1e-6);
    square += apart * apart;
  }
  return std::exp(-0.5 * square);
}

/// Standard deviations of each row: the measurement's noise, and the model error beyond its
/// parameters.
struct RowDeviations {
  Eigen::VectorXd noise, left;
  Eigen::MatrixXd J;  ///< R x P: by the parameters, as far as they count
};

/// Sets the deviations of the position of pose i, in B.
void add_position(const ErrorPrediction& prediction, const Measurement& m, double sigma,
                  const Eigen::MatrixXd& covariance, Index first, RowDeviations& rows) {
  const double noise = std::max(m.sigma.value_or(sigma), sigma);
  const Vector3 variance = (prediction.covariance_B.diagonal().array() - sigma * sigma).max(0.0);
  auto J = rows.J.middleRows<3>(first);
  const Vector3 identified = (J * covariance * J.transpose()).diagonal();
  // A bias corrects a part of the parameters' errors, so their variance counts no more than the
  // model's total.
  const double counts =
      identified.sum() > 0 ? std::min(1.0, variance.sum() / identified.sum()) : 0.0;
  J *= std::sqrt(counts);
  rows.noise.segment<3>(first).setConstant(noise);
  rows.left.segment<3>(first) = (variance - counts * identified).cwiseMax(0.0).cwiseSqrt();
}

void add_rotation(double sigma, double shown, const Eigen::MatrixXd& covariance, Index first,
                  RowDeviations& rows) {
  auto J = rows.J.middleRows<3>(first);
  const double identified = (J * covariance * J.transpose()).trace() / 3;
  rows.noise.segment<3>(first).setConstant(sigma);
  rows.left.segment<3>(first).setConstant(
      std::sqrt(std::max(shown * shown - sigma * sigma - identified, 0.0)));
}

Eigen::MatrixXd covariance_of(const CheckRows& rows, const RowDeviations& deviations,
                              const ModelParts& parts) {
  Eigen::MatrixXd S = deviations.J * parts.covariance * deviations.J.transpose();
  const JointVector range = parts.q_max - parts.q_min;
  for (std::size_t i = 0; i < rows.poses(); ++i) {
    for (std::size_t k = 0; k < rows.poses(); ++k) {
      const double alike = i == k ? 1 : shared(rows.contexts[i], rows.contexts[k], range);
      for (Index a = 0; a < std::min(rows.count[i], rows.count[k]); ++a) {
        const Index row = rows.first[i] + a;
        const Index column = rows.first[k] + a;
        S(row, column) += alike * deviations.left(row) * deviations.left(column);
      }
    }
  }
  S.diagonal() += (1 + kJitter) * deviations.noise.cwiseAbs2();
  return 0.5 * (S + S.transpose());
}

/// The covariance of the model error if it acts as an error of each joint's angle by an arbitrary
/// function, equal for all joints and of the total size of the model error: R x R. Unknown gear
/// errors look like that, and differ between axes. Where orientations are measured, no joint's
/// error turns the tool by more than the orientations leave: a joint whose axis the tool lies on
/// moves no position, however large its error is.
Eigen::MatrixXd left_in_joints(const CheckRows& rows, const RowDeviations& deviations,
                               const CauseEffects& effects, const JointVector& range) {
  const Index R = rows.residual.size();
  std::map<int, Index> columns;  // by joint
  for (const CauseEffects::Entry& entry : effects.causes())
    if (entry.cause.any_function) columns[entry.cause.joint] = entry.columns.front();
  const auto power = [&](const Eigen::VectorXd& of) {
    double sum = 0;
    for (const Index first : rows.first) sum += of.segment<3>(first).squaredNorm();
    return sum;
  };
  const auto power_of_turns = [&](const Eigen::VectorXd& of) {
    double sum = 0;
    for (std::size_t i = 0; i < rows.poses(); ++i)
      sum += of.segment(rows.first[i] + 3, rows.count[i] - 3).squaredNorm();
    return sum;
  };
  const Eigen::VectorXd most = deviations.left.cwiseMax(deviations.noise);
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(R, R);
  for (const auto& [joint, column] : columns) {
    Eigen::VectorXd moved = rows.by_cause.col(column);
    if (!(power(moved) > 0)) continue;
    double share = power(deviations.left) / power(moved);
    if (const double turned = power_of_turns(moved); turned > 0)
      share = std::min(share, power_of_turns(most) / turned);
    moved *= std::sqrt(share / static_cast<double>(columns.size()));
    for (std::size_t i = 0; i < rows.poses(); ++i) {
      for (std::size_t k = 0; k < rows.poses(); ++k) {
        const double apart = (rows.contexts[i].q(joint) - rows.contexts[k].q(joint)) /
                             (kShared * range(joint) + 1e-9);
        S.block(rows.first[i], rows.first[k], rows.count[i], rows.count[k]) +=
            std::exp(-0.5 * apart * apart) * moved.segment(rows.first[i], rows.count[i]) *
            moved.segment(rows.first[k], rows.count[k]).transpose();
      }
    }
  }
  return S;
}

/// The factor by which the model's held-out poses show larger errors than its covariance states. At
/// least 1.
double held_out_factor(const CheckRows& rows, const ModelParts& parts) {
  if (!parts.validation || parts.validation->poses == 0) return 1;
  double expected = 0;
  for (std::size_t i = 0; i < rows.poses(); ++i)
    expected += rows.covariance.diagonal().segment<3>(rows.first[i]).sum();
  expected = std::sqrt(expected / static_cast<double>(rows.poses()));
  return std::max(1.0, parts.validation->compensated.rms / expected);
}

}  // namespace

std::vector<PoseContext> contexts_of(const CompensatedModel& model, const MeasurementBatch& batch) {
  std::vector<PoseContext> contexts;
  for (const Measurement& m : batch.measurements) {
    PoseContext context = m.context;
    context.served = true;
    if (!context.temperature) context.temperature = model.parts().temperature_mean;
    contexts.push_back(std::move(context));
  }
  return contexts;
}

Result<CheckRows> check_rows(const CompensatedModel& model, const MeasurementBatch& batch,
                             const CauseEffects& effects) {
  const ModelParts& parts = model.parts();
  CheckRows rows;
  rows.contexts = contexts_of(model, batch);
  const std::vector<ErrorPrediction> predictions = model.predict_all(rows.contexts);
  const double shown = rotation_shown(parts);
  const bool has_orientation =
      std::any_of(batch.measurements.begin(), batch.measurements.end(),
                  [&](const Measurement& m) { return m.R_WT && shown > 0; });
  const Stand stand = TRY(base_of(batch, predictions, has_orientation, parts.physics.X_WB));
  const Pose& X_WB = stand.X_WB;
  Index next = 0;
  for (const Measurement& m : batch.measurements) {
    rows.pose_ids.push_back(m.pose_id);
    rows.first.push_back(next);
    rows.count.push_back(m.R_WT && shown > 0 ? 6 : 3);
    next += rows.count.back();
  }
  rows.residual.resize(next);
  rows.by_base.resize(next, 6);
  rows.by_cause.resize(next, effects.size());
  RowDeviations deviations{Eigen::VectorXd(next), Eigen::VectorXd(next),
                           Eigen::MatrixXd(next, parts.covariance.rows())};
  const Tracker& tracker = model.cell().tracker;
  const Matrix3 R_BW = parts.physics.X_WB.linear().transpose();
  for (std::size_t i = 0; i < rows.poses(); ++i) {
    const Measurement& m = batch.measurements[i];
    const Index first = rows.first[i];
    const Pose& X_BT = predictions[i].X_BT_predicted;
    rows.predicted.push_back(X_BT);
    const PoseEffects at = effects.at(rows.contexts[i]);
    Eigen::MatrixXd J_W;
    static_cast<void>(parts.physics.pose_W(rows.contexts[i], parts.physics.values, &J_W));
    rows.residual.segment<3>(first) = X_WB.inverse() * m.p_W - X_BT.translation();
    rows.by_base.middleRows(first, rows.count[i]) = at.by_base.topRows(rows.count[i]);
    rows.by_cause.middleRows(first, rows.count[i]) = at.by_cause.topRows(rows.count[i]);
    deviations.J.middleRows<3>(first) = R_BW * J_W.topRows<3>();
    add_position(predictions[i], m, tracker.sigma, parts.covariance, first, deviations);
    if (rows.count[i] == 3) continue;
    rows.residual.segment<3>(first + 3) =
        rotation_log(X_WB.linear().transpose() * *m.R_WT * X_BT.linear().transpose());
    deviations.J.middleRows<3>(first + 3) = R_BW * J_W.bottomRows<3>();
    add_rotation(tracker.sigma_rotation, shown, parts.covariance, first + 3, deviations);
  }
  rows.covariance = covariance_of(rows, deviations, parts) +
                    left_in_joints(rows, deviations, effects, parts.q_max - parts.q_min);
  const double factor = held_out_factor(rows, parts);
  rows.covariance *= factor * factor;
  if (!stand.turns) hold_turn(rows);
  return rows;
}

}  // namespace trammel::health
