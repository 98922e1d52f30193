#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/measurement/checked_batch.h"

/// The rows by which the models of a cell are judged, and the models' errors at them.
namespace trammel {

/// The share of a batch's poses that judge, unless stated otherwise.
inline constexpr double kUsualJudgingShare = 0.2;

/// The rows (Measurement::row) of `batch` that judge models: `share` of its poses, at least 34 if
/// there are 100 or more, and none if there are fewer than 8. The service draws them with `seed`
/// from the rows that the submitter does not hold out (`set`). So a submitter can hold out more
/// rows, but cannot choose the judges. Repeats of a pose are drawn together, since a model must not
/// learn from a copy of a judge. Reproducible: same rows, share and seed give the same judges.
[[nodiscard]] std::set<int> judging_rows(const MeasurementBatch& batch, double share,
                                         std::uint64_t seed);

/// Holds out each judging row, each copy of one, and the rows that the submitter holds out (`set`).
[[nodiscard]] HoldOut held_out_by_service(double share, std::uint64_t seed);

/// One stored batch as it judges. A tracker is set up anew each time, so a session has a base of
/// its own, and each of several in one batch, too.
struct JudgingSession {
  std::string batch_id;
  MeasurementBatch training;  ///< locates the base of this session for each model
  MeasurementBatch judges;    ///< rows that no model was trained on
};
/// `batch` was checked with held_out_by_service().
[[nodiscard]] JudgingSession judging_session(const CheckedBatch& batch);

/// Lets a row that was sent again, under another id or as part of another batch, judge only in the
/// oldest batch. `sessions`: oldest first.
void judge_once(std::vector<JudgingSession>& sessions);
/// `batch` with additional held-out rows: its copies of rows that judge in earlier sessions.
/// Training learns nothing from them.
[[nodiscard]] CheckedBatch without_older_judges(const CheckedBatch& batch,
                                                const std::vector<JudgingSession>& sessions);

/// Measured - predicted of the judging rows of one session, in B, with the base placed by the
/// session's training rows for this very model: 3 x N. A column is not a number if the model does
/// not know the tool or payload. A column of rotations is also not a number without a measured
/// orientation.
struct LocatedErrors {
  Eigen::Matrix3Xd position;       ///< m
  Eigen::Matrix3Xd rotation;       ///< rotation vectors, rad
  Eigen::VectorXd expected;        ///< N, m: the error that the model expects of one measurement,
                                   ///< Euclidean
  Eigen::VectorXd expected_truth;  ///< N, m: the true error that the model expects, Euclidean
};
enum class JudgedLevel { kNominal, kCompensated };
[[nodiscard]] LocatedErrors located_errors(const CompensatedModel& model,
                                           const JudgingSession& session,
                                           JudgedLevel level = JudgedLevel::kCompensated);

/// The share of the joint ranges [q_min, q_max] (rad) that the poses cover, for the joint with the
/// least: the middle 80 % of the poses over 80 % of the range, so a single pose far out does not
/// count. Joints with a range below 1e-3 rad do not count.
[[nodiscard]] double coverage(const std::vector<JointVector>& poses, const JointVector& q_min,
                              const JointVector& q_max);

}  // namespace trammel
