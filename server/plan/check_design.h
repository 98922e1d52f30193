#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/plan/detectable.h"

/// The choice of few poses that show most of the possible changes.
namespace trammel {

/// The parameters of a check's test that a plan needs.
struct CheckTest {
  double sigma = 0, sigma_rotation = 0;  ///< m, rad: of one measurement, one axis
  bool orientation = true;
  bool new_tool = false;      ///< the tool is refitted with the base
  double false_alarm = 1e-4;  ///< of the test of a single cause
  double power = 0.95;
};

/// Numbers that the test of a cause looks at, of `poses` poses.
[[nodiscard]] int freedom_of(const CauseEffects::Entry& entry, int poses);

/// The smallest effect of a cause that is seen at some poses; m, rms over the working poses. Empty:
/// none is.
struct SmallestEffect {
  SingleCause cause;
  std::optional<double> rms;
};

struct CheckDesign {
  std::vector<std::size_t> chosen;       ///< indices of candidates, in the order of choice
  std::vector<SmallestEffect> smallest;  ///< of every testable cause
};

/// Chooses `count` of `candidates` so that the largest of the smallest effects seen is small:
/// greedily, then by exchange. Refuses fewer candidates than `count`.
[[nodiscard]] Result<CheckDesign> check_design(const CauseEffects& effects,
                                               const std::vector<CauseSignal>& signals,
                                               const std::vector<PoseContext>& candidates,
                                               int count, const CheckTest& test);
/// The smallest effects for poses that are given.
[[nodiscard]] std::vector<SmallestEffect> smallest_effects(const CauseEffects& effects,
                                                           const std::vector<CauseSignal>& signals,
                                                           const std::vector<PoseContext>& poses,
                                                           const CheckTest& test);

}  // namespace trammel
