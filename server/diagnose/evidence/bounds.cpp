#include "server/diagnose/evidence/bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/coverage.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr int kSweeps = 200;  // over a dozen numbers: far more than they need

/// The parameter of each number of a source.
std::vector<const Parameter*> parameters_at(const LinearProblem& problem,
                                            const std::vector<Index>& places) {
  std::vector<const Parameter*> all;
  for (const Index place : places)
    all.push_back(&problem.nuisance_parameters()[static_cast<std::size_t>(place)]);
  return all;
}

/// The lower bound of each number in units of its prior. It is minus infinity if the number has
/// none, or if the number only gives the place of an effect.
VectorXd bounds_of(const std::vector<const Parameter*>& parameters) {
  VectorXd bounds(static_cast<Index>(parameters.size()));
  for (Index k = 0; k < bounds.size(); ++k) {
    const Parameter& one = *parameters[static_cast<std::size_t>(k)];
    bounds(k) =
        one.is_place ? -std::numeric_limits<double>::infinity() : one.lower / one.prior_scale;
  }
  return bounds;
}

/// The numbers nearest to the estimate, in the metric of its precision, with none below its bound,
/// found one after the other.
VectorXd nearest_within(const OwnEstimate& own, const VectorXd& bounds) {
  VectorXd x = own.size.cwiseMax(bounds);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Index k = 0; k < x.size(); ++k) {
      const double step = own.precision.row(k).dot(own.size - x) / own.precision(k, k);
      x(k) = std::max(x(k) + step, bounds(k));
    }
  }
  return x;
}

/// The circumstances with which an effect of the cause changes. `joints`: the joints with numbers
/// beyond their bounds, 1-based.
std::vector<std::string> circumstances_of(const CauseRecord& record,
                                          const std::vector<int>& joints) {
  if (record.gives_way) return {"torque"};
  if (record.needs.temperature) return {"temperature"};
  std::vector<std::string> on;
  for (const int joint : joints) on.push_back(fmt::format("q{}", joint));
  if (record.needs.before || record.needs.direction) {
    for (const int joint : joints) on.push_back(fmt::format("dir{}", joint));
  }
  return on;
}

/// The joint to which a number belongs: `early3`. Otherwise the joint of the cause, or 0 if there
/// is none.
int joint_of(const Parameter& parameter, const Cause& cause) {
  if (cause.joint >= 0) return cause.joint + 1;
  const std::size_t end = parameter.name.find_last_not_of("0123456789") + 1;
  return end < parameter.name.size() ? std::stoi(parameter.name.substr(end)) : 0;
}

}  // namespace

bool WrongSign::is_beyond_chance() const {
  const double price = std::pow(thresholds::kWrongSign, 2) +
                       2 * std::log(std::max(1.0, static_cast<double>(numbers.size())));
  return lost > std::max(price, thresholds::kShapeError * strength);
}

bool WrongSign::is_another_cause() const { return is_beyond_chance() && lost > 0.5 * strength; }

WrongSign wrong_sign_of(const LinearProblem& problem, const std::string& source, const Cause& cause,
                        const VectorXd& change, const Eigen::MatrixXd& covariance) {
  const std::vector<Index> places = places_of_source(problem.model(), source);
  const std::vector<const Parameter*> parameters = parameters_at(problem, places);
  const VectorXd bounds = bounds_of(parameters);
  const OwnEstimate own = own_estimate(problem, source, change, covariance);
  const VectorXd off = own.size - nearest_within(own, bounds);
  WrongSign wrong{cause, {}, {}, own.strength(), off.dot(own.precision * off)};
  std::vector<int> joints;
  for (Index k = 0; k < bounds.size(); ++k) {
    const Parameter& one = *parameters[static_cast<std::size_t>(k)];
    const Index place = places[static_cast<std::size_t>(k)];
    const double stddev = std::sqrt(covariance(place, place));
    if (!(own.size(k) < bounds(k) - thresholds::kWrongSign * stddev)) continue;
    const double unit = one.scale * one.prior_scale;
    wrong.numbers.push_back({one.name, one.unit, unit * own.size(k), unit * kExpanded * stddev});
    if (const int joint = joint_of(one, cause); joint > 0) joints.push_back(joint);
  }
  wrong.depends_on = circumstances_of(record_of(cause), joints);
  return wrong;
}

std::string what_wrong_sign_means(const WrongSign& wrong) {
  std::vector<std::string> numbers;
  for (const Estimate& one : wrong.numbers)
    numbers.push_back(
        fmt::format("{} = {:.3g} ± {:.2g} {}", one.name, one.value, one.u95, one.unit));
  return fmt::format(
      "it has the shape of {} with a sign that this cannot have ({}): it is something else",
      in_words(wrong.cause), fmt::join(numbers, ", "));
}

}  // namespace trammel::cause_search
