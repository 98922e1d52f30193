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
  bool another_day = false;  ///< it is rows held out in blocks of time that do without it
};

struct Supported {
  std::vector<std::string> sources;   ///< of those found, in their order
  std::vector<Unsupported> left_out;  ///< in the order in which they were dropped
};

/// Which of the sources `found` lower the squared error of the poses in `judges` by themselves, so
/// that no false one rides on a true one: `own` and all of them are identified on `train`, and
/// again without each in turn. While one is there that the poses do without as well or better, the
/// least is dropped and the rest is asked again. Physics only: a bias would take over what is
/// missing. A single one is not asked: it is what the whole is judged by. `progress`: the share
/// done; false gives up. Refusals as calibrate().
[[nodiscard]] Result<Supported> supported_by(const std::shared_ptr<const Cell>& cell,
                                             const std::vector<std::string>& own,
                                             const std::vector<std::string>& found,
                                             const MeasurementBatch& train,
                                             const MeasurementBatch& judges,
                                             const std::function<bool(double share)>& progress);

/// Asked of `found`: what all but one of them leave of the same poses.
struct SupportQuestion {
  std::vector<std::string> found;
  std::function<Result<Eigen::Matrix3Xd>(const std::vector<std::string>& some)>
      left_by;  ///< 3 x N, m
  std::function<bool(const std::string& source)> may_be_dropped;
  std::function<bool(double share)> progress;  ///< false gives up
};
/// supported_by() of any poses. Refuses what left_by refuses of all of them.
[[nodiscard]] Result<Supported> supported_by(const SupportQuestion& question);

/// `encoder_eccentricity:6 is left out: the poses held out do as well without it (z -0.40)`; empty
/// for none.
[[nodiscard]] std::string to_string(const std::vector<Unsupported>& left_out);

}  // namespace trammel
