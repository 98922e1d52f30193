#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "clients/cli/files/rigid_robot.h"

/// A calibrated robot for other programs.
namespace trammel::cli {

/// URDF of links and joints alone: `world` (the tracker's W), `base_link` (calibrated), `joint_1`
/// ..., `flange`, and a link `tool_NAME` for each tool; `controller_base` is the base as the
/// controller believes it. Lengths in m, angles in rad, to 1e-15. A joint that follows another
/// appears a second time on the same axis and mimics it. Omitted errors are listed in comments, in
/// mm.
[[nodiscard]] std::string urdf_text(const CompensatedModel& model, const RigidRobot& robot);
/// A robot file (models/), with base and tools as a cell file has them in comments.
[[nodiscard]] std::string robot_yaml_text(const CompensatedModel& model, const RigidRobot& robot);
/// CSV: part, parameter, unit, nominal, calibrated, correction, u95; mm and deg. u95 is empty where
/// nothing was identified.
[[nodiscard]] std::string robot_table(const CompensatedModel& model, const RigidRobot& robot);
/// The parts that are left out, for people.
[[nodiscard]] std::string left_out_text(const RigidRobot& robot);
[[nodiscard]] nlohmann::ordered_json robot_json(const CompensatedModel& model,
                                                const RigidRobot& robot);

}  // namespace trammel::cli
