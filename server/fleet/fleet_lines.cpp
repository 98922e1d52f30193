#include "server/fleet/fleet_lines.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/fleet/fleet_prior.h"
#include "server/fleet/student.h"

namespace trammel {

namespace {

constexpr double kAsIfUsual = 3;        // imaginary robots with the usual size of a line
constexpr double kUsualDeviations = 2;  // standard deviations: one of twenty robots exceeds the
                                        // usual size

/// False for base and tool, which do not belong to the arm, and for the rest, which has no value.
bool is_of_the_arm(const BudgetLine& line) {
  return line.value && line.kind != LineKind::kBase && line.kind != LineKind::kTool;
}

std::vector<BudgetNumber> numbers_of(const BudgetLine& line) {
  return line.numbers.empty() ? std::vector{*line.value} : line.numbers;
}

/// The number of the same name in the line of the same name; null: the budget has none.
const BudgetNumber* same_number(const ErrorBudget& budget, const std::string& line,
                                const std::string& name) {
  const BudgetLine* found = budget.line(line);
  if (found == nullptr) return nullptr;
  if (found->value && found->value->name == name) return &*found->value;
  const auto number = std::find_if(found->numbers.begin(), found->numbers.end(),
                                   [&](const BudgetNumber& one) { return one.name == name; });
  return number == found->numbers.end() ? nullptr : &*number;
}

/// The own number held against those of the sisters; `usual`: in its unit, 0: not known.
LineAmongSisters held_against(const BudgetNumber& own, const std::vector<BudgetNumber>& sisters,
                              double usual) {
  const auto n = static_cast<double>(sisters.size());
  double sum = 0, uncertain = 0, squares = 0;
  for (const BudgetNumber& one : sisters) {
    sum += one.value;
    uncertain += one.u95 * one.u95 / 4;
  }
  const double mean = sum / n;
  for (const BudgetNumber& one : sisters) squares += (one.value - mean) * (one.value - mean);
  // The spread contains the uncertainty of each sister.
  const double as_if = usual > 0 ? kAsIfUsual : 0;
  const double spread = (squares + as_if * std::pow(usual / kUsualDeviations, 2)) / (n - 1 + as_if);
  const double next = std::max(spread * (1 + 1 / n), uncertain / (n * n));
  LineAmongSisters line;
  line.own = own;
  line.sisters = {own.name, mean, 2 * std::sqrt(next), own.unit};
  line.robots = static_cast<int>(sisters.size());
  const double stddev = std::sqrt(next + own.u95 * own.u95 / 4);
  line.z = stddev > 0 ? (own.value - mean) / stddev : 0;
  return line;
}

/// The number of a line that is farthest from those of the sisters; empty: too few have it.
std::optional<LineAmongSisters> farthest_of(const BudgetLine& line,
                                            const std::vector<const ErrorBudget*>& sisters,
                                            double usual) {
  std::optional<LineAmongSisters> farthest;
  for (const BudgetNumber& number : numbers_of(line)) {
    std::vector<BudgetNumber> theirs;
    for (const ErrorBudget* sister : sisters)
      if (const BudgetNumber* one = same_number(*sister, line.line, number.name))
        theirs.push_back(*one);
    if (std::ssize(theirs) < kFewestSisters) continue;
    LineAmongSisters one = held_against(number, theirs, usual);
    if (!farthest || std::abs(one.z) > std::abs(farthest->z)) farthest = one;
  }
  if (!farthest) return farthest;
  farthest->line = line.line;
  farthest->name = line.name;
  farthest->joint = line.joint;
  const double value = std::abs(farthest->own.value);
  if (value > 0)
    farthest->difference_rms =
        line.alone_rms * std::abs(farthest->own.value - farthest->sisters.value) / value;
  return farthest;
}

}  // namespace

std::vector<LineAmongSisters> lines_among_sisters(const ErrorBudget& own,
                                                  const std::vector<const ErrorBudget*>& sisters) {
  std::vector<LineAmongSisters> all;
  std::vector<double> chance;  // for each: the chance of such a deviation in a fleet of equal
                               // robots
  for (const BudgetLine& line : own.as_it_stands.lines) {
    if (!is_of_the_arm(line)) continue;
    const double usual =
        line.times_usual.value_or(0) > 0 ? std::abs(line.value->value) / *line.times_usual : 0;
    const std::optional<LineAmongSisters> farthest = farthest_of(line, sisters, usual);
    if (!farthest) continue;
    all.push_back(*farthest);
    chance.push_back(two_sided(farthest->z, farthest->robots - 1 + (usual > 0 ? kAsIfUsual : 0)));
  }
  const double asked = static_cast<double>(all.size()) * (static_cast<double>(sisters.size()) + 1);
  for (std::size_t k = 0; k < all.size(); ++k) all[k].differs = asked * chance[k] <= kFalseFleets;
  std::stable_sort(all.begin(), all.end(), [](const auto& one, const auto& other) {
    if (one.differs != other.differs) return one.differs;
    return one.difference_rms > other.difference_rms;
  });
  return all;
}

std::string to_string(const LineAmongSisters& line) {
  return fmt::format("{} is {}, its {} sisters have {}: {:.3f} mm", line.name, in_words(line.own),
                     line.robots, in_words(line.sisters), to_mm(line.difference_rms));
}

}  // namespace trammel
