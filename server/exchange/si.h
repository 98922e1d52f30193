#pragma once

#include <array>
#include <vector>

#include "server/exchange/answer.h"
#include "server/robot/chain.h"

/// Between the values of this room and SI: poses, vectors and joints. compensate/exchanged.h has
/// whole answers.
namespace trammel::exchange {

[[nodiscard]] Pose from_si(const trammel::Pose& X_AB);
/// A quaternion that is not quite of length 1 is taken as if it were.
[[nodiscard]] trammel::Pose to_si(const Pose& X_AB);

[[nodiscard]] std::array<double, 3> mm_from_si(const Vector3& v);
[[nodiscard]] std::array<double, 3> deg_from_si(const Vector3& v);

[[nodiscard]] Rails rails_of(const Chain& robot);
[[nodiscard]] Rails rails_of(const std::vector<JointType>& types);

/// deg, of a rail mm.
[[nodiscard]] std::vector<double> degrees_from_si(const JointVector& q, const Rails& rails);
/// The same the other way, of as many joints as the robot has.
[[nodiscard]] JointVector si_from_degrees(const std::vector<double>& joints_deg,
                                          const Chain& robot);
/// As joints are asked about: rad, of a rail mm.
[[nodiscard]] std::vector<double> asked_from_si(const JointVector& q, const Rails& rails);
/// Of as many joints as the robot has.
[[nodiscard]] JointVector si_from_asked(const std::vector<double>& q_rad, const Chain& robot);

}  // namespace trammel::exchange
