#include "server/compensate/budget/budget_words.h"

#include <fmt/format.h>

#include <cmath>

#include "server/base/shown_value.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kAlwaysShown =
    0.1;  // of the error: a line beyond the first ones that has more is shown as well

constexpr std::size_t kFewestWrongLengths =
    2;  // that stand out: one may be a link, more are another arm

std::string joined(const std::vector<std::string>& all) {
  return fmt::format("{}", fmt::join(all, ", "));
}

/// What stands behind the name, in brackets.
std::string detail(const BudgetLine& line) {
  std::vector<std::string> parts;
  if (line.value) parts.push_back(in_words(*line.value));
  if (!line.with.empty() && line.kind != LineKind::kUntold)
    parts.push_back("these poses cannot tell it from " + joined(line.with));
  if (line.times_usual && !line.action.empty())
    parts.push_back(fmt::format("{:.0f} times what is usual", *line.times_usual));
  return parts.empty() ? "" : fmt::format(" ({})", fmt::join(parts, "; "));
}

}  // namespace

std::string in_words(const BudgetNumber& number) {
  const ShownValue read = show_read(number.value, number.u95, {1, number.unit});
  return fmt::format("{} ± {} {}", read.value, read.expanded, number.unit);
}

std::string sentence(const BudgetLine& line) {
  if (line.kind == LineKind::kUntold) return fmt::format("{}: {}", line.name, joined(line.with));
  std::string text = line.name + detail(line);
  if (std::isfinite(line.alone_rms))
    text += fmt::format(": {:.3f} mm alone", to_mm(line.alone_rms));
  if (std::isfinite(line.share)) text += fmt::format(", {:.0f} %", 100 * line.share);
  if (!line.action.empty()) text += "; " + line.action;
  return text;
}

std::vector<std::string> difference_in_words(const ModelDifference& difference, int most) {
  std::vector<std::string> text;
  for (BudgetLine line : difference.budget.beyond_frames.lines) {
    if (line.alone_rms <= 0 || most-- <= 0) continue;
    line.action.clear();  // of a difference nothing can be told to be far beyond what is usual
    text.push_back(sentence(line));
  }
  return text;
}

std::string doubt_of_file(const ErrorBudget& budget) {
  std::vector<std::string> lengths;
  for (const BudgetLine& line : budget.as_it_stands.lines)
    if (line.kind == LineKind::kLength && !line.action.empty())
      lengths.push_back(line.name + " by " + in_words(*line.value));
  if (lengths.size() < kFewestWrongLengths) return "";
  return "is this the file of this robot? Several lengths differ from it: " + joined(lengths);
}

std::vector<std::string> in_words(const ErrorBudget& budget, int most) {
  if (budget.as_it_stands.lines.empty()) return {};
  std::vector<std::string> text;
  if (std::string doubt = doubt_of_file(budget); !doubt.empty()) text.push_back(std::move(doubt));
  text.push_back(fmt::format(
      "the drawing is off by {:.3f} mm rms at {} poses; touching base and tool frames would leave "
      "{:.3f} mm",
      to_mm(budget.as_it_stands.error_rms), budget.poses, to_mm(budget.beyond_frames.error_rms)));
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    const bool shown =
        most-- > 0 || std::abs(line.share) > kAlwaysShown || line.kind == LineKind::kUntold;
    if (shown) text.push_back(sentence(line));
  }
  for (const BudgetLine& line : budget.between_sessions)
    text.push_back(
        fmt::format("since session {}, at its poses: {}", line.since_session, sentence(line)));
  return text;
}

}  // namespace trammel
