#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

/// By which rows the models of a cell are judged, and what a model leaves of them.
namespace trammel {

/// The share of a batch's poses that judge, where nobody says another one.
inline constexpr double kUsualJudgingShare = 0.2;

/// The rows (Measurement::row) of `batch` that judge models: `share` of its poses and, of 100 poses
/// and more, at least 34; of fewer than 8 none. Drawn by the service with `seed` from the rows that
/// the submitter does not hold out himself (`set`), so that he can hold out more but not choose who
/// judges. Repeats of a pose are drawn together: a copy of a judge is not learned from.
/// Reproducible: same rows, share and seed, same judges.
[[nodiscard]] std::set<int> judging_rows(const MeasurementBatch& batch, double share,
                                         std::uint64_t seed);

/// Holds out each row that judges, each copy of one that does, and what its submitter holds out
/// (`set`).
[[nodiscard]] HoldOut held_out_by_service(double share, std::uint64_t seed);

/// One stored batch as it judges. A tracker is set up anew each time, so a session has a base of
/// its own, and each of several in one batch, too.
struct JudgingSession {
  std::string batch_id;
  MeasurementBatch training;  ///< tells each model where the base of this session stands
  MeasurementBatch judges;    ///< that no model was trained on
};
/// `batch` was checked with held_out_by_service().
[[nodiscard]] JudgingSession judging_session(const CheckedBatch& batch);

/// Leaves a row that an older batch has as well, because it was sent again under another id or in
/// part, to judge there alone. `sessions`: oldest first.
void judge_once(std::vector<JudgingSession>& sessions);
/// `batch` with its copies of judges of the sessions before its own held out: nothing is learned
/// from them.
[[nodiscard]] CheckedBatch without_older_judges(const CheckedBatch& batch,
                                                const std::vector<JudgingSession>& sessions);

/// Measured - predicted of the judges of one session, in B, with the base where the session's
/// training rows put it for this very model: 3 x N. A column is not a number where the model does
/// not know the tool or payload; of rotations also where no orientation was measured.
struct LocatedErrors {
  Eigen::Matrix3Xd position;       ///< m
  Eigen::Matrix3Xd rotation;       ///< rotation vectors, rad
  Eigen::VectorXd expected;        ///< N, m: what the model expects of one measurement, Euclidean
  Eigen::VectorXd expected_truth;  ///< N, m: what it expects of its true error, Euclidean
};
enum class JudgedLevel { kNominal, kCompensated };
[[nodiscard]] LocatedErrors located_errors(const CompensatedModel& model,
                                           const JudgingSession& session,
                                           JudgedLevel level = JudgedLevel::kCompensated);

/// The share of the joint ranges [q_min, q_max] (rad) that poses spread over, of the joint where it
/// is least: the middle 80 % of the poses over 80 % of the range, so that a single pose far out
/// widens nothing. Joints whose range is below 1e-3 rad do not count.
[[nodiscard]] double coverage(const std::vector<JointVector>& poses, const JointVector& q_min,
                              const JointVector& q_max);

}  // namespace trammel
