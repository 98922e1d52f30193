#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel::cli {

/// The expected error of one target, mm; not finite: not known.
struct ExpectedError {
  double before_mm = 0, after_mm = 0;  ///< rms
  double sigma_mm = 0;                 ///< of each axis
  bool in_domain = true;               ///< near enough to the training data
};

/// The number of targets inside a tolerance about their wanted positions.
struct ToleranceVerdict {
  double tolerance_mm = 0;
  std::size_t targets = 0;                         ///< whose error is known
  std::size_t unknown = 0;                         ///< the others
  std::size_t before = 0;                          ///< inside with 95 % or more, not corrected
  std::size_t after = 0;                           ///< likewise as they are now
  double expected_before = 0, expected_after = 0;  ///< mean number inside
  std::size_t out_of_domain = 0;  ///< of those with a known error: their stated error is a guess
};
/// True if a corrected target is inside with 95 % or more. False if its error is not known.
[[nodiscard]] bool surely_inside(const ExpectedError& target, double tolerance_mm);
[[nodiscard]] ToleranceVerdict tolerance_verdict(const std::vector<ExpectedError>& targets,
                                                 double tolerance_mm);
/// `tolerance 0.2 mm: 33 of 35 targets are inside with 95 % or more (before: 0); 34.1 are expected
/// inside`
[[nodiscard]] std::string verdict_text(const ToleranceVerdict& verdict);
/// Checks the conditions of `correct --strict` on targets, before it writes anything. `left_alone`
/// lists the targets that would stay unchanged, a line each behind its heading; empty: none.
/// Refuses these, and with a tolerance each target that is not inside with 95 %, has an unknown
/// error, or is out of domain; states the number.
[[nodiscard]] Status check_strictly(const std::string& left_alone,
                                    const std::optional<ToleranceVerdict>& verdict);
/// The member `tolerance` in the output of `correct --json`.
[[nodiscard]] nlohmann::ordered_json tolerance_json(const ToleranceVerdict& verdict);

}  // namespace trammel::cli
