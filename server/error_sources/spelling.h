#pragma once

#include <string>
#include <vector>

#include "server/error_sources/catalogue.h"
#include "server/error_sources/error_source.h"

/// Error sources as cell files, levels and models spell them.
namespace trammel {

/// The forms of a cause among which the data decide, the usual one first: `compliance` has three
/// where `cell` carries anything. All other specs stand for themselves.
[[nodiscard]] std::vector<std::string> alternatives(const std::string& spec, const Cell& cell);

/// Makes the source that `spec` names for this cell, in its usual form. A spelling is a cause, then
/// `:joint` (1-based) if it belongs to one joint, then `@numbers` joined by `+` if it has numbers
/// (`gear_transmission:3@48+97`, `tracker_moved@120`). Refuses an unknown name, joint or number. A
/// former name is read as the present one.
[[nodiscard]] Result<ErrorSourcePtr> make_error_source(const std::string& spec, const Cell& cell);

/// `joint_map:*` as one spec for each joint that can have it; all other specs as they are.
[[nodiscard]] std::vector<std::string> spelled_out(const std::vector<std::string>& specs,
                                                   const Cell& cell);

/// The order in which causes act on the arm: frames and links first, causes that depend on the
/// loaded posture last.
[[nodiscard]] bool acts_before(const ErrorSource& one, const ErrorSource& other);

/// Spellings of all causes that an error source describes, in the order in which they act. A cause
/// with several forms appears once for each form.
[[nodiscard]] std::vector<std::string> known_causes();

/// Expands a level into source names: `M0`..`M3`, a list, or a level and more:
/// `M2,gear_transmission:3`.
[[nodiscard]] Result<std::vector<std::string>> parse_level(const std::string& level);
/// The inverse of parse_level(): the level that names these sources; `M0` for none.
[[nodiscard]] std::string level_of(const std::vector<std::string>& sources);
/// The sources of level M3, which a bias is told of in any case.
[[nodiscard]] std::vector<std::string> standard_sources();

/// True if both spellings are of one cause, in any of its forms: `compliance` and
/// `compliance_linear`. Causes of different joints, or that begin at different poses, differ.
[[nodiscard]] bool are_forms_of_one(const std::string& source, const std::string& other);

/// `source` in the spelling of `list`: the cause's name if `list` has it and `source` is one of its
/// forms; otherwise unchanged.
[[nodiscard]] std::string as_listed(const std::string& source,
                                    const std::vector<std::string>& list);

/// True if one of these sources corrects `part` of the nominal cell.
[[nodiscard]] bool corrects(const std::vector<std::string>& sources, causes::Part part);

/// For people: `gear ripple in joint 3` for `gear_transmission:3@48`, `link geometry (d6)` for
/// `geometry:d6`, `the tracker moved from row 40 on`. An unknown spelling is returned unchanged.
[[nodiscard]] std::string in_words(const std::string& spelling);

}  // namespace trammel
