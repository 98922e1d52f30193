#pragma once

#include <span>
#include <vector>

#include "clients/library/trammel/types.h"
#include "server/base/note.h"
#include "server/base/result.h"
#include "server/robot/chain.h"

/// Conversions between the library's values (mm, deg) and SI.
namespace trammel::library {

[[nodiscard]] api::Error to_api(const Error& error);
/// The value, or the error as the library hands it out.
template <typename T>
[[nodiscard]] tl::unexpected<api::Error> passed_on(const Result<T>& failed) {
  return tl::make_unexpected(to_api(failed.error()));
}

[[nodiscard]] std::vector<api::Note> to_api(const std::vector<Note>& notes);

/// Refuses numbers that are not finite and quaternions whose length differs from 1 by more than
/// 1e-3.
[[nodiscard]] Result<Pose> from_api(const api::Pose& X_AB);

/// Refuses another number of joints than the robot has, and numbers that are not finite.
[[nodiscard]] Result<JointVector> joints_from_api(std::span<const double> joints_deg,
                                                  const Chain& robot);
/// Joint vectors one after the other. Refuses likewise, and an incomplete last one; `row` of the
/// error is its index.
[[nodiscard]] Result<std::vector<JointVector>> all_joints_from_api(
    std::span<const double> joints_deg, const Chain& robot);
/// Refuses directions other than -1, 0 and 1, a number of directions other than that of the joints,
/// and an impossible temperature.
[[nodiscard]] Status check_context(const api::Context& context, const Chain& robot);

}  // namespace trammel::library
