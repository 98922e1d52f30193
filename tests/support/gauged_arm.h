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

/// An arm of the second simulation, measured by instruments that give one number per pose.
namespace trammel::test {

struct GaugedArm {
  hidden::World world;
  std::map<std::string, Eigen::Vector3d> anchors_mm;  ///< their places in the world
  std::shared_ptr<const Cell>
      cell;  ///< as drawn; its anchors as `anchors_yaml` of gauged_arm() says
};
/// `anchors_yaml`: the text behind `anchors:`; empty: `anchors_mm`. `more`: further lines.
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
  std::string from_pose = {};  ///< id of a row: a distance from its tool point
};
/// `count` poses with the tool 0.3 to 3 m from their anchor; the anchors take turns.
[[nodiscard]] std::vector<GaugeRow> wire_rows(const GaugedArm& arm, int count, std::uint64_t seed,
                                              double zero_mm = 0);
[[nodiscard]] std::vector<GaugeRow> position_rows(const GaugedArm& arm, int count,
                                                  std::uint64_t seed);
/// A random posture in which the tip of `arm` is at `p_mm`.
[[nodiscard]] hidden::MeasuringPose contact_pose(const hidden::Arm& arm, const hidden::World& world,
                                                 const Eigen::Vector3d& p_mm,
                                                 hidden::Random& random);
/// `count` contacts with the anchor `id`, missed by `sigma_mm` in each direction.
[[nodiscard]] std::vector<GaugeRow> contact_rows(const GaugedArm& arm, const std::string& id,
                                                 int count, double sigma_mm, std::uint64_t seed);
/// Adds to `rows` a distance of about `length_mm` from the first of them.
void add_bar(const GaugedArm& arm, double length_mm, std::uint64_t seed,
             std::vector<GaugeRow>& rows);
/// With noise of `sigma_mm`, but for contacts, whose noise is in their postures; ids p1, p2, ...
[[nodiscard]] std::string gauge_text(const std::vector<GaugeRow>& rows, double sigma_mm,
                                     std::uint64_t seed);
[[nodiscard]] MeasurementBatch gauge_batch(const GaugedArm& arm, const std::vector<GaugeRow>& rows,
                                           double sigma_mm, std::uint64_t seed);

/// The error of the tool position, mm rms over unmeasured poses; `in_base`: after removing a rigid
/// motion of all poses, which is the place of the base.
[[nodiscard]] double volumetric_mm(const GaugedArm& arm, const CalibrationResult& found,
                                   bool in_base, std::uint64_t seed);
/// The smallest possible error of any estimate from these rows (Bayesian Cramér-Rao bound, with
/// derivatives of the second simulation and reasonable uncertainties of its parameters); `known`:
/// the places of the anchors are known.
[[nodiscard]] double least_volumetric_mm(const GaugedArm& arm, const std::vector<GaugeRow>& rows,
                                         double sigma_mm, bool known, bool in_base,
                                         std::uint64_t seed);

}  // namespace trammel::test
