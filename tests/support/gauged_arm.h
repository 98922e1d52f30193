#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/hidden_world.h"

/// An arm of the second simulation, measured by instruments that tell one number of a pose.
namespace trammel::test {

struct GaugedArm {
  hidden::World world;
  std::map<std::string, Eigen::Vector3d> anchors_mm;  ///< where they are, in the world
  std::shared_ptr<const Cell>
      cell;  ///< as drawn; its anchors as `anchors_yaml` of gauged_arm() says
};
/// `anchors_yaml`: what stands behind `anchors:`; empty: `anchors_mm` as they are. `more`: further
/// lines.
[[nodiscard]] GaugedArm gauged_arm(std::uint64_t seed,
                                   const std::map<std::string, Eigen::Vector3d>& anchors_mm,
                                   const std::string& anchors_yaml = "",
                                   const std::string& more = "");
/// Three corners of the cell.
[[nodiscard]] std::map<std::string, Eigen::Vector3d> three_corners();
/// `{a1: {xyz_mm: null}, ...}`
[[nodiscard]] std::string unknown_places(const std::map<std::string, Eigen::Vector3d>& anchors_mm);

/// Rows of a batch to be written.
struct GaugeRow {
  hidden::MeasuringPose pose;
  std::string anchor;      ///< empty: a position
  std::string column;      ///< `distance_mm` or `touch_mm`
  double value_mm = 0;     ///< without noise
  std::string minus_pose;  ///< id of a row
  Eigen::Vector3d p_mm = {0, 0, 0};
};
/// `count` poses whose tool is 0.3 to 3 m from the anchor that each is measured from, the anchors
/// in turns.
[[nodiscard]] std::vector<GaugeRow> wire_rows(const GaugedArm& arm, int count, std::uint64_t seed,
                                              double zero_mm = 0);
[[nodiscard]] std::vector<GaugeRow> position_rows(const GaugedArm& arm, int count,
                                                  std::uint64_t seed);
/// With noise of `sigma_mm`; ids p1, p2, ...
[[nodiscard]] std::string gauge_text(const std::vector<GaugeRow>& rows, double sigma_mm,
                                     std::uint64_t seed);
[[nodiscard]] MeasurementBatch gauge_batch(const GaugedArm& arm, const std::vector<GaugeRow>& rows,
                                           double sigma_mm, std::uint64_t seed);

/// What the tool position is missed by, mm rms over poses that were not measured; `in_base`: but
/// for a rigid motion of all of them, which is where the base stands.
[[nodiscard]] double volumetric_mm(const GaugedArm& arm, const CalibrationResult& found,
                                   bool in_base, std::uint64_t seed);
/// The least that any estimate can miss by with these rows (Bayesian Cramér-Rao bound, derivatives
/// of the second simulation, its parameters as uncertain as they may reasonably be off); `known`:
/// the places of the anchors are.
[[nodiscard]] double least_volumetric_mm(const GaugedArm& arm, const std::vector<GaugeRow>& rows,
                                         double sigma_mm, bool known, bool in_base,
                                         std::uint64_t seed);

}  // namespace trammel::test
