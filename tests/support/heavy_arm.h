#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"
#include "tests/support/hidden_files.h"
#include "tests/support/hidden_world.h"

/// An arm of the second simulation with heavy links, whatever its files state.
namespace trammel::test {

struct HeavyArmSpec {
  std::uint64_t seed = 1;
  bool links_weigh = true;
  bool balancer = false;   ///< a gas spring at joint 2
  bool soft_foot = false;  ///< the base tilts under the arm's moment
  int payloads = 1;        ///< of the cell file; 0: it carries nothing
};

struct HeavyArm {
  hidden::World world;
  std::shared_ptr<const Cell> cell;  ///< as drawn, without masses
};
[[nodiscard]] HeavyArm draw_heavy_arm(const HeavyArmSpec& spec);

/// `poses` poses as its tracker measures them, payloads in turns; `payload`: that one alone (from
/// 0).
[[nodiscard]] MeasurementBatch measured(const HeavyArm& arm, int poses, std::uint64_t seed,
                                        int payload = -1);

/// The same measurements at the caller's poses. Effects hidden by `world.effects` act in both.
[[nodiscard]] MeasurementBatch measured_at(const HeavyArm& arm,
                                           std::vector<hidden::MeasuringPose> poses,
                                           std::uint64_t seed);

}  // namespace trammel::test
