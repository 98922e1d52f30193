#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Which rows are held out: one flag a row. It sees `set` as it was recorded.
using HoldOut = std::function<std::vector<bool>(const MeasurementBatch& batch)>;
/// By the `set` column where the batch has one, else `share` of the rows drawn with `seed`.
[[nodiscard]] HoldOut drawn(double share, std::uint64_t seed);

/// Measurements that fit a cell, and which of them are held out. Whatever learns from a batch or judges by it takes
/// this type, so each batch is checked and split once; check_against_cell() alone makes one.
///
/// Tools and payloads are resolved, times count from the first one that was recorded, and poses of a continuous path
/// have velocities (fill_velocity()). Immutable; copies share their content.
class CheckedBatch {
 public:
  [[nodiscard]] const std::string& id() const { return rows().id; }
  /// All rows, with `set` as it was recorded.
  [[nodiscard]] const MeasurementBatch& rows() const { return content_->rows; }
  /// The rows to learn from; `set` of each is kTrain.
  [[nodiscard]] const MeasurementBatch& training() const { return content_->training; }
  /// The other ones; `set` of each is kValidation.
  [[nodiscard]] const MeasurementBatch& held_out() const { return content_->held_out; }
  [[nodiscard]] std::size_t size() const { return rows().measurements.size(); }
  /// batch_hash() of the batch as it came.
  [[nodiscard]] const std::string& hash() const { return content_->hash; }

  /// With the rows of `flags` (one a row) held out besides.
  [[nodiscard]] CheckedBatch holding_out(const std::vector<bool>& flags) const;
  /// False where times say another order than the rows.
  [[nodiscard]] bool is_in_order_of_time() const;
  /// With the poses in the order in which they were measured, and with the velocities that this order says. What is in
  /// order comes back as it is.
  [[nodiscard]] CheckedBatch in_order_of_time() const;

 private:
  struct Content {
    MeasurementBatch rows, training, held_out;
    std::vector<bool> is_held_out;
    std::string hash;
  };
  CheckedBatch(MeasurementBatch rows, std::vector<bool> is_held_out, std::string hash);
  friend Result<CheckedBatch> check_against_cell(MeasurementBatch batch, const Cell& cell, const HoldOut& hold_out);
  friend Result<CheckedBatch> joined(const std::vector<CheckedBatch>& batches, const Cell& cell);

  std::shared_ptr<const Content> content_;
};

/// The batch made ready for `cell`. Refused when the number or kind of joints, a joint limit, an unknown tool or
/// payload, or several candidates of either stand against it; when the joints look like radians; when positions spread
/// over far more or far less than the robot's own motion does (metres for millimetres).
[[nodiscard]] Result<CheckedBatch> check_against_cell(MeasurementBatch batch, const Cell& cell,
                                                      const HoldOut& hold_out = drawn(0, 0));

/// Batches of one cell as one, in their order: ids joined by plus signs, pose ids `batch/pose`, extra columns left
/// behind. What is held out of each stays held out. One batch comes back as it is. Refuses batches that spread over far
/// more or far less together than the robot's own motion does.
[[nodiscard]] Result<CheckedBatch> joined(const std::vector<CheckedBatch>& batches, const Cell& cell);

}  // namespace trammel
