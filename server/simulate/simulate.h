#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

/// A virtual robot and its tracker: a truth goes in, batches come out.
namespace trammel {

/// The course of a measuring session. Poses without time or temperature get them from here.
struct MeasuringCourse {
  double seconds_per_pose = 0;              ///< s; 0: no time is recorded
  std::optional<double> temperature_start;  ///< degrees Celsius; empty: none is recorded
  double temperature_end = 0;               ///< degrees Celsius, approached exponentially
  double temperature_time_constant = 3600;  ///< s
};

/// A robot with its true parameters.
struct VirtualRobot {
  PhysicalModel truth;
  double sigma = 0;           ///< m, of one measured coordinate
  double sigma_rotation = 0;  ///< rad, of one axis of the measured orientation
  MeasuringCourse course;
};

/// Reads a truth file for the robot of `cell`:
/// ```yaml
/// version: 1
/// error_sources: {base: {x0_mm: 0.5, gamma0_rad: 1.7e-3}, compliance: {C2_rad_per_nmm: 2.8e-10}}
/// noise: {sigma_mm: 0.013, sigma_deg: 0.0035}          # optional; the cell's tracker otherwise
/// base: {xyz_mm: [...], q_wxyz: [...]}                 # where the cell says unknown
/// tools: {probe: {xyz_mm: [...], q_wxyz: [...]}}       # likewise
/// course: {seconds_per_pose: 20, temperature_c: [20, 26], time_constant_s: 3600}   # optional
/// ```
/// Refuses an unknown source, parameter or key.
[[nodiscard]] Result<VirtualRobot> read_virtual_robot(const std::string& path,
                                                      std::shared_ptr<const Cell> cell);

struct SimulateOptions {
  std::uint64_t seed = 1;
  bool orientation = true;  ///< false: positions only, as a single reflector gives
  bool noise = true;
  std::string tool, payload;  ///< empty: the cell's only ones
};

/// Measures the poses of `q` (rows, rad) one after the other. Refuses a wrong number of joints,
/// joints outside their limits, and an unknown tool or payload.
[[nodiscard]] Result<MeasurementBatch> simulate(const VirtualRobot& robot, const Eigen::MatrixXd& q,
                                                const SimulateOptions& options);
/// simulate() for poses with their own direction, time, temperature, tool and payload; the course
/// and the options fill the missing ones.
[[nodiscard]] Result<MeasurementBatch> simulate(const VirtualRobot& robot,
                                                const std::vector<PoseContext>& poses,
                                                const SimulateOptions& options);

}  // namespace trammel
