#pragma once

#include "server/error_sources/error_source.h"

/// Small motions of the tool and of the base, with derivatives by their parameters x, y, z and z,
/// y, x angles.
namespace trammel {

/// Tx Ty Tz Rz Ry Rx from six values.
[[nodiscard]] Pose motion_of(const Eigen::Ref<const Eigen::VectorXd>& values);
/// The axes, in the outer frame, about which the three angles turn (columns).
[[nodiscard]] Matrix3 rotation_axes(const Eigen::Ref<const Eigen::VectorXd>& values);

/// X_FT <- motion(values) X_FT, in F. Earlier columns are carried along.
void move_tool(const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
               StateJacobian* jacobian, int first_column);

/// B moves as seen in W: by motion's translation, and by its rotation about the origin of B.
/// Earlier columns are carried along. `rate` multiplies the values (a drift), and so the new
/// columns.
void move_base_in_world(const Eigen::Ref<const Eigen::VectorXd>& values, double rate,
                        ArmState& state, StateJacobian* jacobian, int first_column);

}  // namespace trammel
