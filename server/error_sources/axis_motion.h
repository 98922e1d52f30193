#pragma once

#include "server/error_sources/error_source.h"

/// Small motions of a joint's axis as seen from the link before it: shifts and tilts that are no
/// error of the joint.
namespace trammel {

/// The motion per unit of each parameter: shift along x, y and z of the joint's first frame (z is
/// its axis), m, and tilt about its x and y, rad.
using AxisMotion = Eigen::Matrix<double, 5, Eigen::Dynamic>;

/// Moves the axis of `joint` by `rates` * `values`: shifts it along the unmoved frame, and tilts it
/// about that frame's origin. Derivatives that were recorded earlier are carried along. Call it
/// before loads act, while the tool has only shifts.
void move_axis(int joint, const AxisMotion& rates, const Eigen::Ref<const Eigen::VectorXd>& values,
               ArmState& state, StateJacobian* jacobian, int first_column);

}  // namespace trammel
