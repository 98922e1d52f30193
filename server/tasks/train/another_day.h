#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/paired_gain.h"
#include "server/measurement/checked_batch.h"
#include "server/robot/cell.h"

/// The gain of causes on a day that nobody measured yet.
namespace trammel {

/// The error on another day, without and with some causes, and the share that they remove.
struct DayGain {
  PairedGain gain;              ///< the physics alone, on all rows judged
  int blocks = 0;               ///< the number of blocks held out in turn
  double share = 0;             ///< 1 - rms after / rms before
  double lower = 0, upper = 0;  ///< 95 % of `share`

  /// True if nothing speaks against the causes on another day.
  [[nodiscard]] bool carries() const { return gain.rms_after <= kNoWorse * gain.rms_before; }
  static constexpr double kNoWorse = 1.01;  // equal models differ by as much
};
/// From the squared errors of the same rows, in their order. Neighbours may share an error: ten
/// rows count as one.
[[nodiscard]] DayGain day_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after);
/// `another day (5 blocks of time held out, instrument set up anew): 0.0210 mm rms, before 0.0250
/// mm: 16 % less, 95 % between 10 and 21 %`.
[[nodiscard]] std::string to_string(const DayGain& day);

/// Shows rows of a batch as another day would. Blocks of time, or whole sessions, are held out in
/// turn, and the physics is identified on the rest. A block is judged as a service would on another
/// day: causes that begin at a pose have begun, earlier rows do not judge, and the instrument
/// stands somewhere else.
class AnotherDay {
 public:
  /// `with`: all found causes, whose instrument effects are removed from the rows. `suspects`: rows
  /// that fit no model. Empty if there are too few rows for three blocks, if some rows are gauges,
  /// or if no block can be predicted.
  [[nodiscard]] static std::optional<AnotherDay> make(const std::shared_ptr<const Cell>& cell,
                                                      const MeasurementBatch& rows,
                                                      const std::vector<std::string>& with,
                                                      const std::set<int>& suspects);
  /// 3 x N, m: the residuals of all judged rows with these sources. Refusals as calibrate().
  [[nodiscard]] Result<Eigen::Matrix3Xd> left_by(const std::vector<std::string>& sources) const;
  [[nodiscard]] int blocks() const { return static_cast<int>(folds_.size()); }

 private:
  struct Fold {
    MeasurementBatch train, judges;  ///< judges: as seen by an instrument that stands still
  };
  std::shared_ptr<const Cell> cell_;
  std::vector<Fold> folds_;
};

}  // namespace trammel
