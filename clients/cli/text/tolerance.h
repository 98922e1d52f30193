#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel::cli {

/// Of one target, mm; not finite: not known.
struct ExpectedError {
  double before_mm = 0, after_mm = 0;  ///< rms
  double sigma_mm = 0;                 ///< of each axis
};

/// How many targets are inside a tolerance about their wanted positions.
struct ToleranceVerdict {
  double tolerance_mm = 0;
  std::size_t targets = 0;                         ///< whose error is known
  std::size_t unknown = 0;                         ///< the others
  std::size_t before = 0;                          ///< inside with 95 % or more, not corrected
  std::size_t after = 0;                           ///< likewise as they are now
  double expected_before = 0, expected_after = 0;  ///< mean number inside
};
[[nodiscard]] ToleranceVerdict tolerance_verdict(const std::vector<ExpectedError>& targets, double tolerance_mm);
/// Refuses, where any target is not inside with 95 %, or its error is not known: nothing is written then.
[[nodiscard]] Status all_inside(const ToleranceVerdict& verdict);
/// `tolerance 0.2 mm: 33 of 35 targets are inside with 95 % or more (before: 0); 34.1 are expected inside`
[[nodiscard]] std::string verdict_text(const ToleranceVerdict& verdict);
/// `tolerance` of what `correct --json` writes.
[[nodiscard]] nlohmann::ordered_json tolerance_json(const ToleranceVerdict& verdict);

}  // namespace trammel::cli
