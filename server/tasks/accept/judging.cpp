#include "server/tasks/accept/judging.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "server/compensate/known_rows.h"
#include "server/measurement/sessions.h"
#include "server/measurement/split.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr double kSamePose = 1e-4;  // rad or m, in each joint
constexpr double kSamePlace =
    1e-6;  // m: of one measurement written twice; another one has noise of its own
constexpr double kEnoughJudges = 34;  // poses: 30 after some turn out bad or out of range
constexpr std::size_t kFewestToDrawFrom =
    8;                                   // poses of a batch: of fewer each is needed to learn from
constexpr double kMostForJudges = 0.34;  // of the poses: fewer stay fewer

using Indices = std::vector<std::size_t>;

bool same_pose(const Measurement& a, const Measurement& b) {
  return a.context.q.size() == b.context.q.size() &&
         (a.context.q - b.context.q).lpNorm<Eigen::Infinity>() <= kSamePose;
}

/// Rows of one pose together, in the order of their first rows.
std::vector<Indices> poses_of(const MeasurementBatch& batch) {
  const auto& rows = batch.measurements;
  Indices order(rows.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return rows[a].context.q(0) < rows[b].context.q(0);
  });
  std::vector<Indices> poses;
  std::vector<bool> taken(rows.size(), false);
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (taken[order[k]]) continue;
    Indices pose;
    for (std::size_t other = k; other < order.size(); ++other) {
      if (rows[order[other]].context.q(0) > rows[order[k]].context.q(0) + kSamePose) break;
      if (taken[order[other]] || !same_pose(rows[order[k]], rows[order[other]])) continue;
      taken[order[other]] = true;
      pose.push_back(order[other]);
    }
    std::sort(pose.begin(), pose.end());
    poses.push_back(std::move(pose));
  }
  std::sort(poses.begin(), poses.end());
  return poses;
}

double judges_of(std::size_t poses, double share) {
  const auto n = static_cast<double>(poses);
  const double drawn = std::round(share * n);
  return kEnoughJudges <= kMostForJudges * n ? std::max(drawn, kEnoughJudges) : drawn;
}

/// The poses drawn, each with all its rows.
std::vector<Indices> drawn_poses(const MeasurementBatch& batch, double share, std::uint64_t seed) {
  std::vector<Indices> poses = poses_of(batch);
  std::erase_if(poses, [&](const Indices& pose) {
    return std::all_of(pose.begin(), pose.end(), [&](std::size_t i) {
      return batch.measurements[i].set == MeasurementSet::kValidation;
    });
  });
  if (poses.size() < kFewestToDrawFrom) return {};
  const double wanted = judges_of(poses.size(), share) / static_cast<double>(poses.size());
  const std::vector<bool> is_drawn = drawn_of(poses.size(), wanted, seed);
  std::vector<Indices> drawn;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (is_drawn[k]) drawn.push_back(std::move(poses[k]));
  }
  return drawn;
}

/// Measurements to recognise.
class JudgeRows {
 public:
  void add(const MeasurementBatch& batch) {
    for (const Measurement& m : batch.measurements) rows_.emplace(m.p_W.x(), m);
  }
  [[nodiscard]] bool has(const Measurement& m) const {
    const auto end = rows_.upper_bound(m.p_W.x() + kSamePlace);
    return std::any_of(rows_.lower_bound(m.p_W.x() - kSamePlace), end,
                       [&](const std::pair<const double, Measurement>& row) {
                         const Vector3 apart = row.second.p_W - m.p_W;
                         return same_pose(row.second, m) &&
                                apart.cwiseAbs().maxCoeff() <= kSamePlace;
                       });
  }

 private:
  std::multimap<double, Measurement> rows_;  // by the first coordinate
};

/// The base that fits the predictions `p_B` to `p_W`, without rows far off the others; `otherwise`
/// if it is undetermined.
Pose located_base(const Eigen::Matrix3Xd& p_W, const Eigen::Matrix3Xd& p_B, const Pose& otherwise) {
  constexpr int kRounds = 5;
  constexpr double kFar = 6;  // times the median distance
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < p_W.cols(); ++i) kept.push_back(i);
  Pose X_WB = otherwise;
  for (int round = 0; round < kRounds; ++round) {
    if (kept.size() < 3) return X_WB;
    const Result<Pose> fitted = fit_transform(p_W(Eigen::all, kept), p_B(Eigen::all, kept));
    if (!fitted) return X_WB;
    X_WB = *fitted;
    Eigen::VectorXd distance(p_W.cols());
    for (Eigen::Index i = 0; i < p_W.cols(); ++i)
      distance(i) = (p_W.col(i) - X_WB * p_B.col(i)).norm();
    std::vector<double> sorted(distance.begin(), distance.end());
    std::nth_element(sorted.begin(),
                     sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double limit = kFar * sorted[sorted.size() / 2];
    std::vector<Eigen::Index> near;
    for (Eigen::Index i = 0; i < distance.size(); ++i) {
      if (distance(i) <= limit) near.push_back(i);
    }
    if (near == kept) break;
    kept = std::move(near);
  }
  return X_WB;
}

Eigen::Matrix3Xd measured_W(const MeasurementBatch& batch) {
  Eigen::Matrix3Xd p_W(3, static_cast<Eigen::Index>(batch.measurements.size()));
  for (Eigen::Index i = 0; i < p_W.cols(); ++i)
    p_W.col(i) = batch.measurements[static_cast<std::size_t>(i)].p_W;
  return p_W;
}

}  // namespace

std::set<int> judging_rows(const MeasurementBatch& batch, double share, std::uint64_t seed) {
  std::set<int> rows;
  for (const Indices& pose : drawn_poses(batch, share, seed)) {
    for (const std::size_t i : pose) {
      if (batch.measurements[i].set != MeasurementSet::kValidation)
        rows.insert(batch.measurements[i].row);
    }
  }
  return rows;
}

HoldOut held_out_by_service(double share, std::uint64_t seed) {
  return [share, seed](const MeasurementBatch& batch) {
    std::vector<bool> held_out;
    for (const Measurement& m : batch.measurements)
      held_out.push_back(m.set == MeasurementSet::kValidation);
    for (const Indices& pose : drawn_poses(batch, share, seed)) {
      for (const std::size_t i : pose) held_out[i] = true;
    }
    return held_out;
  };
}

JudgingSession judging_session(const CheckedBatch& batch) {
  JudgingSession session{batch.id(), batch.training(), batch.held_out()};
  std::set<int> by_submitter;
  for (const Measurement& m : batch.rows().measurements) {
    if (m.set == MeasurementSet::kValidation) by_submitter.insert(m.row);
  }
  std::erase_if(session.judges.measurements,
                [&](const Measurement& m) { return by_submitter.contains(m.row); });
  return session;
}

void judge_once(std::vector<JudgingSession>& sessions) {
  JudgeRows older;
  for (JudgingSession& session : sessions) {
    const MeasurementBatch drawn = session.judges;
    std::erase_if(session.judges.measurements, [&](const Measurement& m) { return older.has(m); });
    older.add(session.training);
    older.add(drawn);
  }
}

CheckedBatch without_older_judges(const CheckedBatch& batch,
                                  const std::vector<JudgingSession>& sessions) {
  JudgeRows judges;
  for (const JudgingSession& session : sessions) {
    if (session.batch_id == batch.id()) break;
    judges.add(session.judges);
  }
  std::vector<bool> copies;
  for (const Measurement& m : batch.rows().measurements) copies.push_back(judges.has(m));
  return batch.holding_out(copies);
}

namespace {

/// The errors of one set-up of the instrument.
LocatedErrors errors_of_one(const CompensatedModel& model, const JudgingSession& session,
                            JudgedLevel level) {
  const auto N = static_cast<Eigen::Index>(session.judges.measurements.size());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  LocatedErrors located{Eigen::Matrix3Xd::Constant(3, N, nan),
                        Eigen::Matrix3Xd::Constant(3, N, nan), Eigen::VectorXd::Constant(N, nan),
                        Eigen::VectorXd::Constant(N, nan)};
  const auto at_level = [level](const auto& errors) -> const Eigen::Matrix3Xd& {
    return level == JudgedLevel::kNominal ? errors.nominal : errors.compensated;
  };
  const MeasurementBatch training = known_rows(model, session.training);
  const MeasurementBatch judges = known_rows(model, session.judges);
  if (judges.measurements.empty()) return located;
  const Pose X_BW = model.parts().physics.X_WB.inverse();
  Pose X_WB = model.parts().physics.X_WB;
  if (!training.measurements.empty()) {
    const Eigen::Matrix3Xd p_W = measured_W(training);
    X_WB = located_base(p_W, X_BW * p_W - at_level(model.errors_B(training)), X_WB);
  }
  const Pose change =
      X_WB.inverse() * X_BW.inverse();  // takes a pose in the model's B to B as placed here
  const CompensatedModel::LevelErrors errors = model.errors_B(judges);
  const Eigen::Matrix3Xd p_W = measured_W(judges);
  const double instrument = 3 * model.cell().tracker.sigma * model.cell().tracker.sigma;
  Eigen::Index known = 0, oriented = 0;
  for (Eigen::Index i = 0; i < N; ++i) {
    const Measurement& m = session.judges.measurements[static_cast<std::size_t>(i)];
    if (!knows(model, m)) continue;
    const Vector3 predicted_B = X_BW * p_W.col(known) - at_level(errors).col(known);
    located.position.col(i) = X_WB.inverse() * p_W.col(known) - predicted_B;
    located.expected(i) = errors.stddev.col(known).norm();
    located.expected_truth(i) =
        std::sqrt(std::max(0.0, errors.stddev.col(known).squaredNorm() - instrument));
    ++known;
    if (!m.R_WT) continue;
    located.rotation.col(i) =
        rotation_log(change.linear() * rotation_exp(at_level(errors.rotation).col(oriented)));
    ++oriented;
  }
  return located;
}

}  // namespace

LocatedErrors located_errors(const CompensatedModel& model, const JudgingSession& session,
                             JudgedLevel level) {
  if (!has_sessions(session.judges)) return errors_of_one(model, session, level);
  const auto N = static_cast<Eigen::Index>(session.judges.measurements.size());
  LocatedErrors all{Eigen::Matrix3Xd(3, N), Eigen::Matrix3Xd(3, N), Eigen::VectorXd(N),
                    Eigen::VectorXd(N)};
  const std::vector<MeasurementBatch> training = by_session(session.training),
                                      judges = by_session(session.judges);
  Eigen::Index at = 0;  // rows of one set-up stand together
  for (std::size_t s = 0; s < judges.size(); ++s) {
    const LocatedErrors one =
        errors_of_one(model, {session.batch_id, training[s], judges[s]}, level);
    const Eigen::Index n = one.position.cols();
    all.position.middleCols(at, n) = one.position;
    all.rotation.middleCols(at, n) = one.rotation;
    all.expected.segment(at, n) = one.expected;
    all.expected_truth.segment(at, n) = one.expected_truth;
    at += n;
  }
  return all;
}

double coverage(const std::vector<JointVector>& poses, const JointVector& q_min,
                const JointVector& q_max) {
  constexpr double kMiddle = 0.8;
  constexpr double kNoRange = 1e-3;  // rad or m
  if (poses.size() < 2) return 0;
  double least = 1;
  std::vector<double> values(poses.size());
  for (Eigen::Index j = 0; j < q_min.size(); ++j) {
    const double range = q_max(j) - q_min(j);
    if (range < kNoRange) continue;
    std::transform(poses.begin(), poses.end(), values.begin(),
                   [j](const JointVector& q) { return q(j); });
    std::sort(values.begin(), values.end());
    const auto at = [&](double share) {
      return values[static_cast<std::size_t>(
          std::lround(share * static_cast<double>(values.size() - 1)))];
    };
    least = std::min(least, (at(0.5 + kMiddle / 2) - at(0.5 - kMiddle / 2)) / (kMiddle * range));
  }
  return least;
}

}  // namespace trammel
