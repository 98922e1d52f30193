#include "server/diagnose/tell/findings.h"

#include <algorithm>
#include <cmath>

#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/diagnose/evidence/beginning.h"
#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/tell/wording.h"

namespace trammel {

namespace {

using causes::Summary;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDwarfed = 0.25;   // of the size of what is unknown
constexpr double kOthersSpeak = 5;  // nat

/// The joint estimate of everything, about the model's values, in units of priors.
struct Estimated {
  VectorXd change;
  MatrixXd covariance;
};

Estimate in_units(const Parameter& parameter, double value, double stddev) {
  return {parameter.name, parameter.unit, parameter.scale * value, parameter.scale * kExpanded * stddev};
}

/// Of a sine and a cosine: their common amplitude and what it is uncertain by.
Estimate amplitude_of(const std::string& name, const Eigen::Vector2d& value, const Eigen::Matrix2d& covariance) {
  const double amplitude = value.norm();
  const Eigen::Vector2d slope = amplitude > 0 ? Eigen::Vector2d(value / amplitude) : Eigen::Vector2d::UnitX();
  return {name, "urad", 1e6 * amplitude, 1e6 * kExpanded * std::sqrt(slope.dot(covariance * slope))};
}

/// What a map makes of a joint's angle between the two poses that it moves farthest apart. `values`: a sine and a
/// cosine of every harmonic, rad.
Estimate peak_to_peak_of(const MeasurementBatch& batch, int joint, const VectorXd& values, const MatrixXd& covariance) {
  const auto functions = [&](double q) {
    VectorXd f(values.size());
    for (Index h = 0; 2 * h + 1 < f.size(); ++h) {
      f(2 * h) = std::sin(static_cast<double>(h + 1) * q);
      f(2 * h + 1) = std::cos(static_cast<double>(h + 1) * q);
    }
    return f;
  };
  VectorXd lowest;
  VectorXd highest;
  for (const Measurement& m : batch.measurements) {
    const VectorXd here = functions(m.context.q(joint));
    if (lowest.size() == 0 || values.dot(here) < values.dot(lowest)) lowest = here;
    if (highest.size() == 0 || values.dot(here) > values.dot(highest)) highest = here;
  }
  const VectorXd across = highest - lowest;
  return {"peak_to_peak", "urad", 1e6 * values.dot(across),
          1e6 * kExpanded * std::sqrt(across.dot(covariance * across))};
}

std::vector<Estimate> parameters_of(const LinearProblem& problem, const std::string& source, const Cause& cause,
                                    const Estimated& estimated) {
  const std::vector<Index> places = places_of_source(problem.model(), source);
  std::vector<Estimate> estimates;
  VectorXd values(static_cast<Index>(places.size()));
  MatrixXd covariance(values.size(), values.size());
  const auto& priors = problem.nuisance_parameters();
  for (Index i = 0; i < values.size(); ++i) {
    const Index k = places[static_cast<std::size_t>(i)];
    const double scale = priors[static_cast<std::size_t>(k)].prior_scale;
    values(i) = problem.model().values(k) + scale * estimated.change(k);
    for (Index j = 0; j < values.size(); ++j) {
      const Index other = places[static_cast<std::size_t>(j)];
      covariance(i, j) = scale * priors[static_cast<std::size_t>(other)].prior_scale * estimated.covariance(k, other);
    }
  }
  const Summary summary = record_of(cause).summary;
  if (summary == Summary::kOrderAndAmplitude) {
    estimates.push_back({"order", "", values(0), kExpanded * std::sqrt(covariance(0, 0))});
    estimates.push_back(amplitude_of("amplitude", values.segment<2>(1), covariance.block<2, 2>(1, 1)));
  } else if (summary == Summary::kAmplitude) {
    estimates.push_back(amplitude_of("amplitude", values.head<2>(), covariance.topLeftCorner<2, 2>()));
  } else if (summary == Summary::kPeakToPeak && values.size() > 0) {
    estimates.push_back(peak_to_peak_of(problem.batch(), cause.joint, values, covariance));
  }
  if (!cause.parameter.empty()) {
    const OwnEstimate own = own_estimate(problem, source, estimated.change, estimated.covariance);
    for (Index i = 0; i < values.size(); ++i) {
      const Parameter& parameter = priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])];
      if (parameter.name != cause.parameter) continue;
      // The others of its source at zero: it is this one that is named.
      const double alone = own.precision.row(i).dot(own.size) / own.precision(i, i);
      return {
          in_units(parameter, parameter.prior_scale * alone, parameter.prior_scale / std::sqrt(own.precision(i, i)))};
    }
  }
  for (Index i = 0; i < values.size(); ++i) {
    const Parameter& parameter = priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])];
    if (parameter.is_place) continue;
    if (summary == Summary::kPeakToPeak) break;  // a hundred harmonics tell people nothing
    estimates.push_back(in_units(parameter, values(i), std::sqrt(covariance(i, i))));
  }
  return estimates;
}

/// Whether other numbers of its source than the one that a cause is named by are there as well. That one is estimated
/// with the others at zero, which then would be wrong.
bool others_speak(const LinearProblem& problem, const Accepted& one, const Estimated& estimated) {
  if (one.cause.parameter.empty()) return false;
  const OwnEstimate own = own_estimate(problem, one.in_model, estimated.change, estimated.covariance);
  const std::vector<Index> places = places_of_source(problem.model(), one.in_model);
  const auto& priors = problem.nuisance_parameters();
  for (Index i = 0; i < own.size.size(); ++i) {
    if (priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])].name != one.cause.parameter) continue;
    const double alone = std::pow(own.precision.row(i).dot(own.size), 2) / own.precision(i, i);
    return log_evidence(own.strength() - alone, static_cast<double>(own.size.size() - 1)) > kOthersSpeak;
  }
  return false;
}

std::vector<Index> all_but(Index count, const std::vector<Index>& left_out) {
  std::vector<Index> kept;
  for (Index k = 0; k < count; ++k) {
    if (std::find(left_out.begin(), left_out.end(), k) == left_out.end()) kept.push_back(k);
  }
  return kept;
}

/// The poses at which `one` may have begun, given what `effect` it has and everything else that is free.
std::vector<PossibleBeginning> beginnings_of(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                                             const Accepted& one, const VectorXd& effect, const Background& rest) {
  const auto family = std::find_if(families.begin(), families.end(), [&](const FamilyPtr& other) {
    const Cause cause = other->cause(other->typical());
    return other->predicts() && !cause.pose_id.empty() && cause.cause == one.cause.cause &&
           cause.joint == one.cause.joint;
  });
  const auto& poses = problem.batch().measurements;
  const auto found =
      std::find_if(poses.begin(), poses.end(), [&](const Measurement& m) { return m.pose_id == one.cause.pose_id; });
  if (one.cause.pose_id.empty() || family == families.end() || found == poses.end()) return {};
  Best always;
  always.at = 0;
  std::vector<PossibleBeginning> beginnings;
  for (const Index i : possible_beginnings(problem, (*family)->columns(always), rest, problem.residual() + effect,
                                           static_cast<Index>(found - poses.begin()))) {
    const Measurement& m = poses[static_cast<std::size_t>(i)];
    beginnings.push_back({m.pose_id, m.row, m.context.time});
  }
  return beginnings;
}

Finding outlier(const Accepted& one, double noise, const ErrorFigures& held_out) {
  Finding finding;
  finding.cause = one.cause;
  finding.parameters = {{"distance", "mm", to_mm(one.pose.distance), to_mm(kExpanded * noise)}};
  finding.effect_rms = one.pose.distance;
  finding.strength = one.best.strength;
  finding.p_value = one.p_value;
  finding.held_out_before = finding.held_out_after = held_out;
  finding.action = action_for(one.cause, {});
  return finding;
}

}  // namespace

std::vector<Finding> findings_of(const SearchResult& found, const LinearProblem& problem) {
  const MatrixXd columns = background_columns(problem, found.unnamed);
  const Background all(columns);
  const Estimated estimated{all.estimate(problem.residual()), all.covariance()};
  const Folds folds(problem, columns);
  const VectorXd held_out = folds.held_out_residual(problem.residual());
  const bool begins = std::any_of(found.accepted.begin(), found.accepted.end(), [](const Accepted& one) {
    return !one.source.empty() && !one.cause.pose_id.empty();
  });
  const std::vector<FamilyPtr> families = begins ? make_families(problem) : std::vector<FamilyPtr>();
  std::vector<Finding> findings;
  for (const Accepted& one : found.accepted) {
    if (one.source.empty()) {
      findings.push_back(outlier(one, problem.noise(), figures_of(problem.positions(held_out))));
      continue;
    }
    Finding finding;
    finding.cause = one.cause;
    if (others_speak(problem, one, estimated)) finding.cause.parameter.clear();
    finding.source = one.source;
    finding.parameters = parameters_of(problem, one.in_model, finding.cause, estimated);
    if (finding.cause.order && !finding.parameters.empty()) finding.cause.order = finding.parameters.front().value;
    const std::vector<Index> places = places_of_source(problem.model(), one.in_model);
    const VectorXd effect = effect_of_source(problem, one.in_model);
    const Background rest(columns(Eigen::all, all_but(columns.cols(), places)));
    finding.effect_rms = problem.position_rms(rest.project(effect));
    finding.may_begin_at = beginnings_of(problem, families, one, effect, rest);
    finding.strength = own_estimate(problem, one.in_model, estimated.change, estimated.covariance).strength();
    finding.p_value = one.p_value;
    finding.naming_frequency = one.naming_frequency;
    finding.could_also_be = one.could_also_be;
    finding.held_out_after = figures_of(problem.positions(held_out));
    finding.held_out_before = figures_of(
        problem.positions(folds.held_out_residual(problem.residual() + effect, all_but(columns.cols(), places))));
    finding.held_out_gain = finding.held_out_before.rms - finding.held_out_after.rms;
    finding.action = action_for(one.cause, one.could_also_be);
    findings.push_back(std::move(finding));
  }
  return findings;
}

void doubt_beside(const Unexplained& unexplained, std::vector<Finding>& findings) {
  if (!unexplained.present) return;
  for (Finding& finding : findings) {
    if (finding.source.empty() || finding.effect_rms > kDwarfed * unexplained.rms) continue;
    finding.could_also_be.push_back(unknown_cause());
    finding.action = "find first what is unknown here: it is several times larger";
  }
}

namespace {

/// The causes that describe a single one of its kind as well, and better where there are several: a map of the joint's
/// angle for ripples of one gear.
std::vector<const CauseRecord*> doubts_about(const CauseRecord& record) {
  std::vector<const CauseRecord*> general;
  for (const CauseRecord* other : all_causes()) {
    if (std::any_of(other->rivals.begin(), other->rivals.end(), [&](const causes::Rival& rival) {
          return rival.likeness == causes::Likeness::kDoubtfulCase && rival.cause == record.spelling;
        }))
      general.push_back(other);
  }
  return general;
}

}  // namespace

void doubt_single_orders(std::vector<Finding>& findings) {
  constexpr int kFewOrders = 2;
  const auto at_joint = [&](const CauseRecord& cause, int joint) {
    return std::count_if(findings.begin(), findings.end(), [&](const Finding& other) {
      return &record_of(other.cause) == &cause && other.cause.joint == joint;
    });
  };
  for (Finding& finding : findings) {
    const int joint = finding.cause.joint;
    const CauseRecord& own = record_of(finding.cause);
    for (const CauseRecord* general : doubts_about(own)) {
      if (at_joint(*general, joint) == 0 && at_joint(own, joint) <= kFewOrders) continue;
      const Cause map = cause_at(*general, joint);
      if (std::find(finding.could_also_be.begin(), finding.could_also_be.end(), map) != finding.could_also_be.end())
        continue;
      finding.could_also_be.push_back(map);
      finding.action =
          fmt::format("measure more poses over the range of joint {}: its error has no single order", joint + 1);
    }
  }
}

HeldOut held_out_of(const LinearProblem& before, const LinearProblem& after) {
  const auto of = [](const LinearProblem& problem, const MatrixXd& columns) {
    return figures_of(problem.positions(Folds(problem, columns).held_out_residual(problem.residual())));
  };
  return {of(before, before.nuisance()), of(after, after.nuisance())};
}

}  // namespace trammel
