#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Chooses the rows that are held out: one flag per row. The batch still has `set` as it was
/// recorded.
using HoldOut = std::function<std::vector<bool>(const MeasurementBatch& batch)>;
/// Chooses by the `set` column if the batch has one, else draws `share` of the poses at random with
/// `seed`.
[[nodiscard]] HoldOut drawn(double share, std::uint64_t seed);

/// A batch that was checked against a cell and split into training and held-out rows. All training
/// and validation code takes this type, so each batch is checked and split once. Only
/// check_against_cell() makes one.
///
/// A batch with its tools and payloads resolved. Rows of a session stand together
/// (divide_into_sessions()), times count from the first recorded time of their session, and poses
/// of a continuous path have velocities (fill_velocity()). Immutable; copies share their content.
class CheckedBatch {
 public:
  [[nodiscard]] const std::string& id() const { return rows().id; }
  /// All rows, with `set` as it was recorded.
  [[nodiscard]] const MeasurementBatch& rows() const { return content_->rows; }
  /// The rows to learn from; `set` of each is kTrain.
  [[nodiscard]] const MeasurementBatch& training() const { return content_->training; }
  /// The rows held out; `set` of each is kValidation.
  [[nodiscard]] const MeasurementBatch& held_out() const { return content_->held_out; }
  [[nodiscard]] std::size_t size() const { return rows().measurements.size(); }
  /// batch_hash() of the batch as it came.
  [[nodiscard]] const std::string& hash() const { return content_->hash; }

  /// A copy in which the rows of `flags` (one per row) are held out as well.
  [[nodiscard]] CheckedBatch holding_out(const std::vector<bool>& flags) const;
  /// False if the recorded times contradict the order of the rows.
  [[nodiscard]] bool is_in_order_of_time() const;
  /// A copy with the poses in the order of their times, and with the velocities of `robot` in that
  /// order. A batch that is in order is returned unchanged.
  [[nodiscard]] CheckedBatch in_order_of_time(const Chain& robot) const;

 private:
  struct Content {
    MeasurementBatch rows, training, held_out;
    std::vector<bool> is_held_out;
    std::string hash;
  };
  CheckedBatch(MeasurementBatch rows, std::vector<bool> is_held_out, std::string hash);
  friend Result<CheckedBatch> check_against_cell(MeasurementBatch batch, const Cell& cell,
                                                 const HoldOut& hold_out);
  friend CheckedBatch joined(std::vector<CheckedBatch> batches);

  std::shared_ptr<const Content> content_;
};

/// The batch made ready for `cell`. Refuses a wrong number or kind of joints, a joint beyond its
/// limit, an unknown tool or payload, and a missing name where the cell has several. Refuses joints
/// that look like radians, and positions that spread far more or far less than the robot's own
/// motion (metres for millimetres).
[[nodiscard]] Result<CheckedBatch> check_against_cell(MeasurementBatch batch, const Cell& cell,
                                                      const HoldOut& hold_out = drawn(0, 0));

/// Joins batches of one cell into one, in the order of time if the instruments' clocks give it,
/// otherwise in the given order. Each batch becomes a session, or keeps its own sessions, because
/// the tracker may have been set up anew. The ids are joined by plus signs, pose ids become
/// `batch/pose`, extra columns are dropped. Held-out rows stay held out. A row that equals one of
/// an earlier batch to the last digit is the same measurement under another name: it is dropped and
/// counted in `copies`. A single batch is returned unchanged.
[[nodiscard]] CheckedBatch joined(std::vector<CheckedBatch> batches);

}  // namespace trammel
