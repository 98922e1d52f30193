#pragma once

#include "server/diagnose/search/scan.h"

namespace trammel::cause_search {

/// True if `whole` is `step` from the first pose on: a displaced base for a tracker that moved, for
/// example. A step near the first pose looks the same, and is the less likely of the two.
[[nodiscard]] bool is_whole_of(const Cause& whole, const Cause& step);

/// The part of the nominal cell that the cause corrects; for a step, the part that it corrects from
/// a pose on.
[[nodiscard]] causes::Part part_of(const Cause& cause);

/// True if `general` is only a more general description of `special`, not another cause.
[[nodiscard]] bool is_description_of(const Cause& general, const Cause& special);

/// True if `simple` should be named when it explains nearly as much as `general`.
[[nodiscard]] bool is_simpler_case(const Cause& simple, const Cause& general);

/// True if the name `special` is uncertain when `general`, which includes it, is equally likely: an
/// order of a gear beside a map of its joint's angle.
[[nodiscard]] bool is_doubtful_case(const Cause& general, const Cause& special);

/// The certainty of a cause's name.
struct Naming {
  double frequency = 1;  ///< share of repetitions of the batch, the effect as fitted, that name it
  std::vector<Cause> could_also_be;  ///< explain the data as well
};

/// Causes that would look like `cause`, and that no recorded quantity of the batch can rule out.
[[nodiscard]] std::vector<Cause> untestable_rivals(const Cause& cause,
                                                   const MeasurementBatch& batch);

/// Tests the family at `place` in `seen` in two ways: it repeats the batch in simulation with the
/// fitted effect, and it compares other named causes on the data and on that effect.
[[nodiscard]] Naming name_or_doubt(const LinearProblem& problem,
                                   const std::vector<FamilyPtr>& families,
                                   const Background& background, const Scan& seen,
                                   const Chance& chance, std::size_t place, std::uint64_t seed);

}  // namespace trammel::cause_search
