#pragma once

#include "server/error_sources/error_source.h"

/// The makers of every known error source, one a file. `joint` is 0-based, -1 where the spec names none.
namespace trammel {

[[nodiscard]] Result<ErrorSourcePtr> make_base(const Cell& cell, int joint);
[[nodiscard]] Result<ErrorSourcePtr> make_tool(const Cell& cell, int joint);
[[nodiscard]] Result<ErrorSourcePtr> make_geometry(const Cell& cell, int joint);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_first_order(const Cell& cell, int joint);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_equilibrium(const Cell& cell, int joint);
[[nodiscard]] Result<ErrorSourcePtr> make_compliance_linear(const Cell& cell, int joint);

}  // namespace trammel
