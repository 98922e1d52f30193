#include "server/compensate/budget/after_repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/budget/error_budget.h"

namespace trammel {

namespace {

bool is_sure(const BudgetNumber& number) { return std::abs(number.value) > number.u95; }

/// True if a person would repair the line: it stands out, or it is a zero that the poses determine.
bool is_to_put_right(const BudgetLine& line) {
  if (!line.value) return false;
  return !line.action.empty() || (line.kind == LineKind::kJointZero && is_sure(*line.value) &&
                                  line.times_usual.value_or(0) > 1);
}

LineOutcome::Helped judged(const LineOutcome& outcome, double usual) {
  using Helped = LineOutcome::Helped;
  const double before = outcome.before.value, now = outcome.now.value;
  if (outcome.moved.u95 > std::abs(before)) return Helped::kCannotTell;
  if (std::abs(now) <= std::max(outcome.now.u95, usual)) return Helped::kPutRight;
  if (!is_sure(outcome.moved)) return Helped::kNotMoved;
  if (outcome.moved.value * before > 0) return Helped::kWrongWay;
  return now * before > 0 ? Helped::kPartly : Helped::kTooFar;
}

LineOutcome outcome_of(const BudgetLine& before, const AfterRepair& repair) {
  LineOutcome outcome{before.line, before.name,   before.action,   *before.value,
                      {},          *before.value, before.alone_rms};
  const BudgetLine* moved = repair.difference.budget.line(before.line);
  if (moved == nullptr || !moved->value) return outcome;
  outcome.moved = *moved->value;
  outcome.now.value = outcome.before.value + outcome.moved.value;
  outcome.now.u95 = std::hypot(outcome.before.u95, outcome.moved.u95);
  const BudgetLine* now = repair.now.line(before.line);
  if (now != nullptr && now->value && now->value->name == before.value->name)
    outcome.now = *now->value;
  const double usual =
      before.times_usual.value_or(0) > 0 ? std::abs(before.value->value) / *before.times_usual : 0;
  outcome.helped = judged(outcome, usual);
  return outcome;
}

std::string said(const LineOutcome& outcome) {
  using Helped = LineOutcome::Helped;
  switch (outcome.helped) {
    case Helped::kPutRight:
      return "put right";
    case Helped::kPartly:
      return "put right in part";
    case Helped::kTooFar:
      return "moved too far";
    case Helped::kNotMoved:
      return "not moved";
    case Helped::kWrongWay:
      return "moved the wrong way";
    case Helped::kCannotTell:
      return "these poses cannot tell whether it moved";
  }
  return "";
}

}  // namespace

std::string_view to_string(LineOutcome::Helped helped) {
  constexpr std::string_view kWords[] = {"put_right", "partly",    "too_far",
                                         "not_moved", "wrong_way", "cannot_tell"};
  return kWords[static_cast<std::size_t>(helped)];
}

AfterRepair after_repair(const CompensatedModel& before, const CompensatedModel& now,
                         const std::vector<PoseContext>& poses) {
  AfterRepair repair{before.provenance().id,
                     error_budget(before, poses),
                     error_budget(now, poses),
                     difference_between(before, now, poses),
                     {}};
  for (const BudgetLine& line : repair.before.as_it_stands.lines)
    if (is_to_put_right(line)) repair.lines.push_back(outcome_of(line, repair));
  std::stable_sort(repair.lines.begin(), repair.lines.end(),
                   [](const LineOutcome& one, const LineOutcome& other) {
                     return one.alone_before > other.alone_before;
                   });
  return repair;
}

std::vector<std::string> in_words(const AfterRepair& repair, int most) {
  std::vector<std::string> text = {fmt::format(
      "since model {}: at these {} poses the drawing was off by {:.3f} mm rms beyond frames, and "
      "is now by {:.3f} mm",
      repair.model, repair.now.poses, to_mm(repair.before.beyond_frames.error_rms),
      to_mm(repair.now.beyond_frames.error_rms))};
  if (repair.lines.empty()) text.emplace_back("nothing stood out in that model");
  for (const LineOutcome& line : repair.lines) {
    std::string sentence = fmt::format("{}: was {}", line.name, in_words(line.before));
    if (line.helped != LineOutcome::Helped::kCannotTell)
      sentence += fmt::format(", moved by {}, is {}", in_words(line.moved), in_words(line.now));
    text.push_back(fmt::format("{}: {}", sentence, said(line)));
  }
  for (const BudgetLine& line : repair.difference.budget.beyond_frames.lines) {
    const bool known = std::any_of(repair.lines.begin(), repair.lines.end(),
                                   [&](const LineOutcome& one) { return one.line == line.line; });
    if (known || !line.value || !is_sure(*line.value) || most-- <= 0) continue;
    BudgetLine moved = line;
    moved.action.clear();
    text.push_back("also moved: " + sentence(moved));
  }
  return text;
}

}  // namespace trammel
