#include "server/compensate/budget/budget.h"

#include <algorithm>
#include <array>

namespace trammel {

namespace {

constexpr std::array<std::string_view, 12> kKinds = {
    "base",  "joint_zero", "length",   "twist",  "tool", "joint_compliance",
    "cause", "learned",    "together", "untold", "rest", "instrument"};

}  // namespace

std::string_view to_string(LineKind kind) { return kKinds.at(static_cast<std::size_t>(kind)); }

std::string BudgetLine::cause_or_kind() const {
  return kind == LineKind::kCause ? cause : std::string(to_string(kind));
}

const BudgetLine* ErrorBudget::line(std::string_view name) const {
  const auto& lines = as_it_stands.lines;
  const auto found =
      std::find_if(lines.begin(), lines.end(), [&](const BudgetLine& l) { return l.line == name; });
  return found == lines.end() ? nullptr : &*found;
}

std::optional<LineKind> line_kind(std::string_view spelled) {
  const auto found = std::find(kKinds.begin(), kKinds.end(), spelled);
  if (found == kKinds.end()) return std::nullopt;
  return static_cast<LineKind>(found - kKinds.begin());
}

}  // namespace trammel
