#pragma once

#include "server/error_sources/error_source.h"

/// Small motions of a joint's axis as seen from the link before it: shifts and tilts that are no
/// error of the joint.
namespace trammel {

/// The motion that a unit of each parameter makes: shift along x, y and z of the frame that the
/// joint starts from (z its axis), m, and tilt about its x and y, rad.
using AxisMotion = Eigen::Matrix<double, 5, Eigen::Dynamic>;

/// Moves the axis of `joint` by `rates` * `values`: shifted along the frame as it
/// was, and tilted about its origin. Earlier
/// columns are carried along. To be called while the tool has no motion of its own but shifts
/// (before loads act).
void move_axis(int joint, const AxisMotion& rates, const Eigen::Ref<const Eigen::VectorXd>& values,
               ArmState& state, StateJacobian* jacobian, int first_column);

}  // namespace trammel
