#pragma once

#include <string>
#include <vector>

#include "server/error_sources/error_source.h"

/// The makers of every known error source, one a file.
namespace trammel {

/// `gear_transmission:3@48.5+97`: a cause, the joint it concerns, and what else says which one is meant.
struct SourceSpec {
  std::string text;        ///< as spelled
  std::string name;        ///< the cause
  int joint = -1;          ///< 0-based; -1 where none is named
  std::vector<double> at;  ///< after the @: orders, or the pose (1-based row of the batch) at which it begins
};

using SourceMaker = Result<ErrorSourcePtr> (*)(const SourceSpec& spec, const Cell& cell);

[[nodiscard]] Result<ErrorSourcePtr> make_base(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_tool(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_tool_changed(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_geometry(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_thermal_growth(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_gear_transmission(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_encoder_eccentricity(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_joint_map(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_wrist_coupling(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_joint_slip(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_time_lag(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_tracker_moved(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_tracker_drift(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_payload(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_payload_changed(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_backlash(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_link_bending(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_first_order(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_equilibrium(const SourceSpec& spec, const Cell& cell);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_linear(const SourceSpec& spec, const Cell& cell);

}  // namespace trammel
