#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"
#include "server/robot/gauge.h"
#include "server/robot/pose_context.h"

/// Measured tool poses with the joints that were commanded.
namespace trammel {

enum class MeasurementSet { kUnassigned, kTrain, kValidation };

struct Measurement {
  std::string pose_id;
  PoseContext context;
  Vector3 p_W = Vector3::Zero();  ///< measured tool point, m; not a number for a gauge
  std::optional<Matrix3> R_WT;    ///< tool orientation as measured, active W <- T
  std::optional<Gauge> gauge;     ///< one number instead of a position (gauges.h)
  std::optional<double> sigma;    ///< m, of one axis of this point, or of the gauge
  std::optional<double>
      sigma_rotation;  ///< rad, of one axis of this orientation, if it differs from the tracker's
  MeasurementSet set = MeasurementSet::kUnassigned;
  std::string session_id;  ///< the recorded set-up of the instrument; empty: the batch is one
  int session = 0;         ///< its place in MeasurementBatch::sessions
  int row = 0;             ///< line in its file, for messages
  std::vector<std::string> extra;  ///< values of the batch's extra columns
};

/// Measurements taken together. The order is the order in time.
struct MeasurementBatch {
  std::string id;     ///< name given at submission, else the file's name without its extension
  std::string where;  ///< the file as messages name it; empty = not from a file
  std::vector<Measurement> measurements;
  std::vector<JointType>
      joint_types;  ///< from the columns: `q1_deg` or, for a rail, `q7_mm`; empty = the robot's
  std::vector<std::string>
      extra_columns;        ///< header names of columns that Trammel does not know, kept
  std::string source_text;  ///< the CSV as it came
  std::optional<std::int64_t> measured_at =
      {};  ///< Unix time, s, of the newest measurement; empty = unknown
  std::optional<std::int64_t> clock =
      {};  ///< measured_at if the instrument's clock gave it, otherwise empty
  /// Names of its sessions in the order of time, whose rows stand together; empty: the whole batch
  /// is one. A session has a frame W of its own, because the tracker was set up anew.
  std::vector<std::string> sessions = {};
  int copies = 0;        ///< rows that were left out: an earlier batch has them, see joined()
  bool as_then = false;  ///< true: its poses keep their index among those of a model, so causes
                         ///< that began later do not act on them
};

/// The batch with measured_at set: the latest `time_s` if that column is Unix time, else
/// `taken_in`. `taken_in` is when the batch was received or its file was written (Unix time, s). A
/// time before September 2001, or more than a day after `taken_in`, is no Unix time.
[[nodiscard]] MeasurementBatch dated(MeasurementBatch batch, std::int64_t taken_in);

/// Reads the batch CSV of DESIGN section 3. Refuses an empty file, a missing or repeated column, a
/// row of another length, a number that is not finite, a quaternion that is not normalised (limit
/// 1e-3), a sigma that is not positive, a direction outside -1, 0, +1, and two rows with one
/// pose_id. The error names `where`, row, column, value and limit. An empty field in an optional
/// column means that nothing was recorded. Joints are counted, but not checked against a robot. A
/// row has a position, or one of `distance_mm` and `touch_mm` with `anchor_id`, optionally against
/// the pose `minus_pose_id`, or a `distance_mm` from the pose `from_pose_id`. A `distance_mm` of 0
/// to an anchor is a contact. A row to which such an id refers may have no value; it is then not a
/// measurement.
[[nodiscard]] Result<MeasurementBatch> parse_batch_csv(const std::string& text,
                                                       const std::string& where);
[[nodiscard]] Result<MeasurementBatch> read_batch_csv(const std::string& path);
/// The batch as parse_batch_csv() reads it; optional columns only where a row has them.
[[nodiscard]] std::string to_csv(const MeasurementBatch& batch);
/// SHA-256 of the batch as received, or of to_csv() if it has no source text.
[[nodiscard]] std::string batch_hash(const MeasurementBatch& batch);

}  // namespace trammel
