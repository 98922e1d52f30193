#include "server/compensate/budget/budget_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/error_sources/catalogue.h"
#include "server/error_sources/spelling.h"

namespace trammel {

namespace {

constexpr double kAlwaysShown = 0.1;  // share of the error: later lines with more are shown as well

constexpr std::ptrdiff_t kMostToLead = 3;

constexpr std::size_t kFewestWrongLengths =
    2;  // lines that stand out: one may be a link, more suggest another arm

std::string joined(const std::vector<std::string>& all) {
  return fmt::format("{}", fmt::join(all, ", "));
}

/// The angle by which a frame is turned, with its uncertainty along the axis. The numbers count as
/// independent.
std::optional<BudgetNumber> turn_of(const BudgetLine& line) {
  if (line.kind != LineKind::kBase && line.kind != LineKind::kTool) return std::nullopt;
  double square = 0, variance = 0;
  for (const BudgetNumber& number : line.numbers) {
    if (number.unit != "deg") continue;
    square += number.value * number.value;
    variance += std::pow(number.value * number.u95, 2);
  }
  if (square <= 0) return std::nullopt;
  return BudgetNumber{"turn", std::sqrt(square), std::sqrt(variance / square), "deg"};
}

bool stands_out(const BudgetLine& line) { return !line.action.empty(); }

/// True for a change that began while the poses were measured. It is no error of the drawing, so it
/// is reported as a finding.
bool is_a_change(const BudgetLine& line) {
  const CauseRecord* record = find_cause(line.cause);
  return record != nullptr && record->lasting == causes::Lasting::kFromAPose;
}

/// The details behind the name, in brackets.
std::string detail(const BudgetLine& line) {
  std::vector<std::string> parts;
  if (line.value) parts.push_back(value_in_words(line));
  if (!line.with.empty() && line.kind != LineKind::kUntold)
    parts.push_back("these poses cannot tell it from " + partners_in_words(line));
  if (line.times_usual && !line.action.empty())
    parts.push_back(fmt::format("{:.0f} times what is usual", *line.times_usual));
  return parts.empty() ? "" : fmt::format(" ({})", fmt::join(parts, "; "));
}

}  // namespace

std::string in_words(const BudgetNumber& number) {
  const ShownValue read = show_read(number.value, number.u95, {1, number.unit});
  return fmt::format("{} ± {} {}", read.value, read.expanded, number.unit);
}

std::string value_in_words(const BudgetLine& line) {
  if (!line.value) return "";
  const std::optional<BudgetNumber> turn = turn_of(line);
  return in_words(*line.value) + (turn ? ", turned by " + in_words(*turn) : "");
}

std::string line_in_words(const std::string& line) {
  static constexpr std::array<std::array<std::string_view, 2>, 3> kOfLinks = {
      {{"zero:", "the zero of joint "},
       {"length:", "the lengths of link "},
       {"twist:", "the angles of link "}}};
  for (const auto& [spelled, words] : kOfLinks)
    if (line.starts_with(spelled)) return fmt::format("{}{}", words, line.substr(spelled.size()));
  return in_words(line);
}

std::string partners_in_words(const BudgetLine& line) {
  std::vector<std::string> names;
  std::transform(line.with.begin(), line.with.end(), std::back_inserter(names), line_in_words);
  return joined(names);
}

std::string sentence(const BudgetLine& line) {
  if (line.kind == LineKind::kUntold)
    return fmt::format("{}: {}", line.name, partners_in_words(line));
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
    line.action.clear();  // a difference has no usual size that it could exceed
    text.push_back(sentence(line));
  }
  return text;
}

bool is_usual(const std::vector<BudgetLine>& lines) {
  const bool asked = std::any_of(lines.begin(), lines.end(), [](const BudgetLine& line) {
    return line.kind == LineKind::kJointZero || line.kind == LineKind::kLength;
  });
  return asked && std::none_of(lines.begin(), lines.end(), stands_out);
}

std::string doubt_of_file(const ErrorBudget& budget) {
  std::vector<std::string> lengths;
  for (const BudgetLine& line : budget.as_it_stands.lines)
    if (line.kind == LineKind::kLength && !line.action.empty())
      lengths.push_back(line.name + " by " + in_words(*line.value));
  if (lengths.size() < kFewestWrongLengths) return "";
  return "is this the file of this robot? Several lengths differ from it: " + joined(lengths);
}

std::string lead_of(const ErrorBudget& budget) {
  std::vector<std::string> largest, actions;
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    if (!stands_out(line) || is_a_change(line) || std::ssize(largest) == kMostToLead) continue;
    largest.push_back(fmt::format("{}, {}: {:.3f} mm alone", line.name, value_in_words(line),
                                  to_mm(line.alone_rms)));
    actions.push_back(line.action);
  }
  if (largest.empty()) return "";
  return fmt::format("the drawing is off by {:.3f} mm rms, because of {}. What to do: {}",
                     to_mm(budget.as_it_stands.error_rms), fmt::join(largest, "; "),
                     fmt::join(actions, "; "));
}

std::vector<std::string> in_words(const ErrorBudget& budget, int most) {
  if (budget.as_it_stands.lines.empty()) return {};
  std::vector<std::string> text;
  if (std::string doubt = doubt_of_file(budget); !doubt.empty()) text.push_back(std::move(doubt));
  const std::vector<BudgetLine>& lines = budget.as_it_stands.lines;
  text.push_back(fmt::format(
      "the drawing is off by {:.3f} mm rms at {} poses; touching base and tool frames would leave "
      "{:.3f} mm{}",
      to_mm(budget.as_it_stands.error_rms), budget.poses, to_mm(budget.beyond_frames.error_rms),
      is_usual(lines) ? "; no zero, length, angle or tool is far from what arms of its kind show"
                      : ""));
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    const bool shown =
        most-- > 0 || std::abs(line.share) > kAlwaysShown || line.kind == LineKind::kUntold;
    if (shown) text.push_back(sentence(line));
  }
  for (const BudgetLine& line : budget.between_sessions)
    text.push_back(
        fmt::format("at the poses since session {}: {}", line.since_session, sentence(line)));
  return text;
}

}  // namespace trammel
