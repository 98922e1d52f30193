#pragma once

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// True if `whole` is `step` from the first pose on: a base that is elsewhere for a tracker that
/// moved, and so on. A step near the first pose looks like it, and is the less likely of the two.
[[nodiscard]] bool is_whole_of(const Cause& whole, const Cause& step);

/// Which part of the nominal cell the cause corrects; of a step, the part that it corrects from a
/// pose on.
[[nodiscard]] causes::Part part_of(const Cause& cause);

/// True if `general` is only a more general description of `special`, not another cause.
[[nodiscard]] bool is_description_of(const Cause& general, const Cause& special);

/// True if `simple` is the one to name where it explains nearly as much as `general` does.
[[nodiscard]] bool is_simpler_case(const Cause& simple, const Cause& general);

/// True if the name `special` is unsure if `general`, of which it is a case, is as likely: an order
/// of a gear beside a map of its joint's angle.
[[nodiscard]] bool is_doubtful_case(const Cause& general, const Cause& special);

/// The certainty of a cause's name.
struct Naming {
  double frequency = 1;  ///< share of repetitions of the batch, the effect as fitted, that name it
  std::vector<Cause> could_also_be;  ///< explain the data as well
};

/// Causes that would look like `cause`, and for which the batch records nothing that could rule
/// them out.
[[nodiscard]] std::vector<Cause> untestable_rivals(const Cause& cause,
                                                   const MeasurementBatch& batch);

/// Doubts the family at `place` in `seen`: by repeating the batch in simulation with the effect as
/// it was fitted, and by what other named causes explain of the data and of that effect.
[[nodiscard]] Naming name_or_doubt(const LinearProblem& problem,
                                   const std::vector<FamilyPtr>& families,
                                   const Background& background, const Scan& seen,
                                   const Chance& chance, std::size_t place, std::uint64_t seed);

}  // namespace trammel::cause_search
