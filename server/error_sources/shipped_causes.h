#pragma once

#include "server/error_sources/cause.h"

/// One line per cause, in the order in which diagnosis looks for them. Consecutive causes of a
/// joint are looked for joint by joint.
#define TRAMMEL_SHIPPED_CAUSES(CAUSE) \
  CAUSE(base)                         \
  CAUSE(geometry)                     \
  CAUSE(tool)                         \
  CAUSE(compliance)                   \
  CAUSE(wrist_coupling)               \
  CAUSE(tracker_moved)                \
  CAUSE(tool_changed)                 \
  CAUSE(encoder_eccentricity)         \
  CAUSE(backlash)                     \
  CAUSE(payload)                      \
  CAUSE(payload_changed)              \
  CAUSE(link_bending)                 \
  CAUSE(tracker_drift)                \
  CAUSE(time_lag)                     \
  CAUSE(thermal_growth)               \
  CAUSE(joint_slip)                   \
  CAUSE(gear_transmission)            \
  CAUSE(joint_map)                    \
  CAUSE(self_weight)                  \
  CAUSE(balancer)                     \
  CAUSE(base_compliance)              \
  CAUSE(joint_coupling)               \
  CAUSE(cable_pull)                   \
  CAUSE(axis_runout)                  \
  CAUSE(loaded_ripple)                \
  CAUSE(rail_scale)                   \
  CAUSE(rack_pitch)                   \
  CAUSE(rail_straightness)            \
  CAUSE(early_reading)                \
  CAUSE(hysteresis)                   \
  CAUSE(thermal_zero)                 \
  CAUSE(lagged_growth)                \
  CAUSE(instrument_scale)             \
  CAUSE(outlier)                      \
  CAUSE(drift)                        \
  CAUSE(unknown)

/// The records that ship, each defined beside its physics in the file of its cause.
namespace trammel::causes {

#define TRAMMEL_DECLARE_CAUSE(name) [[nodiscard]] const CauseRecord& name();
TRAMMEL_SHIPPED_CAUSES(TRAMMEL_DECLARE_CAUSE)
#undef TRAMMEL_DECLARE_CAUSE

}  // namespace trammel::causes
