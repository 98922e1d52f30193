#pragma once

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

namespace trammel {

/// A source that poses held out do not speak for.
struct Unsupported {
  std::string source;
  /// sum(d) / sqrt(sum(d²)), d the difference of a pose's squared errors without and with it
  /// (Efron, Student's t-test under symmetry conditions, JASA 64, 1969): not above 0.
  double z = 0;
  bool another_day = false;  ///< rows held out in blocks of time do without it
};

struct Supported {
  std::vector<std::string> sources;   ///< the supported ones of those found, in their order
  std::vector<Unsupported> left_out;  ///< in the order in which they were dropped
};

/// Selects the sources of `found` that each lower the squared error of the poses in `judges`, so
/// that no false one benefits from a true one. `own` and all of them are identified on `train`, and
/// again without each in turn. While the poses do equally well or better without some source, the
/// weakest is dropped and the others are tested again. It uses physics only, since a bias would
/// absorb the missing effect. A single source is not tested here, since the extension as a whole is
/// judged by it. `progress`: the share done; false gives up. Refusals as calibrate().
[[nodiscard]] Result<Supported> supported_by(const std::shared_ptr<const Cell>& cell,
                                             const std::vector<std::string>& own,
                                             const std::vector<std::string>& found,
                                             const MeasurementBatch& train,
                                             const MeasurementBatch& judges,
                                             const std::function<bool(double share)>& progress);

/// The question for `found`: the residuals of the same poses with all but one of them.
struct SupportQuestion {
  std::vector<std::string> found;
  std::function<Result<Eigen::Matrix3Xd>(const std::vector<std::string>& some)>
      left_by;  ///< 3 x N, m
  std::function<bool(const std::string& source)> may_be_dropped;
  std::function<bool(double share)> progress;  ///< false gives up
};
/// supported_by() for any poses. Refuses the same as left_by does for all sources.
[[nodiscard]] Result<Supported> supported_by(const SupportQuestion& question);

/// `encoder_eccentricity:6 is left out: the poses held out do as well without it (z -0.40)`. Empty
/// if no source is left out.
[[nodiscard]] std::string to_string(const std::vector<Unsupported>& left_out);

}  // namespace trammel
