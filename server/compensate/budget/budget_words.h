#pragma once

#include <string>
#include <vector>

#include "server/compensate/budget/between.h"
#include "server/compensate/budget/budget.h"

namespace trammel {

/// `3.000 ± 0.004 deg`.
[[nodiscard]] std::string in_words(const BudgetNumber& number);

/// The value of a line, for a frame with the angle of its turn. Empty: it has none.
[[nodiscard]] std::string value_in_words(const BudgetLine& line);

/// For people: `the zero of joint 4` for `zero:4`.
[[nodiscard]] std::string line_in_words(const std::string& line);
/// The lines that the poses cannot distinguish from this one.
[[nodiscard]] std::string partners_in_words(const BudgetLine& line);

/// One line for people: `the zero of joint 4 (joint 4 stands 3.000 ± 0.004 deg beyond the angle
/// shown): 14.6 mm alone, 46 %`.
[[nodiscard]] std::string sentence(const BudgetLine& line);

/// `is this the file of this robot? ...` if several lengths stand out; else empty.
[[nodiscard]] std::string doubt_of_file(const ErrorBudget& budget);

/// True if zeros or lengths were identified and no line stands out.
[[nodiscard]] bool is_usual(const std::vector<BudgetLine>& lines);

/// The lines that stand out and their repairs, in one sentence. Empty: no line stands out.
[[nodiscard]] std::string lead_of(const ErrorBudget& budget);

/// The budget in its `most` first lines, beneath a heading that names the whole error, and
/// above it doubt_of_file(). Empty
/// without lines.
[[nodiscard]] std::vector<std::string> in_words(const ErrorBudget& budget, int most = 6);

/// The difference between two models in its `most` first lines, after the part that touching frames
/// would remove.
[[nodiscard]] std::vector<std::string> difference_in_words(const ModelDifference& difference,
                                                           int most = 6);

}  // namespace trammel
