#include "server/fleet/fleet_prior.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unsupported/Eigen/SpecialFunctions>

#include "server/base/shown_value.h"
#include "server/fleet/student.h"

namespace trammel {

namespace {

using Eigen::Index;

constexpr double kTails = 4;        // degrees of freedom of a deviation from the mean
constexpr double kAsIfRobots = 3;   // for the parameter's kind, added to those of the parameter
constexpr double kCorrelated = 10;  // likewise, without any correlation
constexpr int kRounds = 60;

/// The message of one robot's own poses on the parameters: information, and information times
/// value, in prior scales.
struct Said {
  Eigen::MatrixXd information;
  Eigen::VectorXd weighted;
};

bool is_of_the_arm(const ErrorSource& source) {
  const CauseRecord& cause = source.cause();
  return cause.lasting == causes::Lasting::kAlways &&
         (cause.scope == causes::Scope::kArm || cause.scope == causes::Scope::kJoint);
}

/// Names of the arm's parameters, with their places.
std::map<std::string, Index> arm_parameters(const PhysicalModel& physics) {
  std::map<std::string, Index> places;
  Index next = 0;
  for (const ErrorSourcePtr& source : physics.sources) {
    for (const Parameter& parameter : source->parameters()) {
      if (is_of_the_arm(*source) && !parameter.is_place) places[parameter.name] = next;
      ++next;
    }
  }
  return places;
}

/// The prior of the training, taken out of its posterior.
Said said_by(const ModelParts& parts, const std::vector<Index>& places,
             const Eigen::VectorXd& scale) {
  Eigen::MatrixXd covariance = parts.covariance(places, places);
  covariance = scale.cwiseInverse().asDiagonal() * covariance * scale.cwiseInverse().asDiagonal();
  covariance.diagonal().array() += 1e-12;
  const Index P = scale.size();
  const Eigen::MatrixXd precision = covariance.llt().solve(Eigen::MatrixXd::Identity(P, P));
  Eigen::VectorXd value(P), prior(P), prior_precision(P);
  for (Index k = 0; k < P; ++k) {
    const IdentifiedParameter& one =
        parts.parameters[static_cast<std::size_t>(places[static_cast<std::size_t>(k)])];
    value(k) = one.value / scale(k);
    prior(k) = one.parameter.prior / scale(k);
    prior_precision(k) = std::pow(scale(k) / one.parameter.prior_scale, 2);
  }
  Eigen::MatrixXd information = precision;
  information.diagonal() -= prior_precision;
  // Rounding may leave directions with less than nothing.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      0.5 * (information + information.transpose()));
  const Eigen::MatrixXd& V = eigen.eigenvectors();
  Said said;
  said.information = V * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
  said.weighted = precision * value - prior_precision.cwiseProduct(prior);
  return said;
}

/// Parameters by expectation maximisation, in prior scales.
struct Learned {
  Eigen::VectorXd mean, variance;
  Eigen::MatrixXd deviations;  ///< robots x P, expected
};

/// Parameters of one kind have similar spreads. For quantities that cannot be below 0 these are
/// shares of their means.
struct Kind {
  std::string unit;
  bool positive = false;
};

Eigen::VectorXd shrunk(const Eigen::VectorXd& sums, const Eigen::VectorXd& mean, double robots,
                       const std::vector<Kind>& of) {
  Eigen::VectorXd size = Eigen::VectorXd::Ones(sums.size());
  for (Index k = 0; k < sums.size(); ++k)
    if (of[static_cast<std::size_t>(k)].positive) size(k) = std::max(mean(k) * mean(k), 1e-6);
  std::map<std::string, std::pair<double, int>> kinds;
  for (Index k = 0; k < sums.size(); ++k) {
    auto& [sum, count] = kinds[of[static_cast<std::size_t>(k)].unit];
    sum += std::log(std::max(sums(k) / robots / size(k), 1e-12));
    ++count;
  }
  Eigen::VectorXd variance(sums.size());
  for (Index k = 0; k < sums.size(); ++k) {
    const auto& [sum, count] = kinds.at(of[static_cast<std::size_t>(k)].unit);
    variance(k) =
        (sums(k) + kAsIfRobots * size(k) * std::exp(sum / count)) / (robots + kAsIfRobots);
  }
  return variance;
}

Learned learned_from(const std::vector<Said>& robots, const std::vector<Kind>& kinds) {
  const Index P = robots.front().weighted.size();
  const auto n = static_cast<Index>(robots.size());
  Learned now{Eigen::VectorXd::Zero(P), Eigen::VectorXd::Constant(P, 1.0),
              Eigen::MatrixXd::Zero(n, P)};
  Eigen::MatrixXd weights = Eigen::MatrixXd::Ones(n, P);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::MatrixXd expected(n, P), uncertain(n, P);
    for (Index r = 0; r < n; ++r) {
      const Said& said = robots[static_cast<std::size_t>(r)];
      const Eigen::VectorXd precision = weights.row(r).transpose().cwiseQuotient(now.variance);
      const Eigen::MatrixXd posterior = said.information + Eigen::MatrixXd(precision.asDiagonal());
      const Eigen::LLT<Eigen::MatrixXd> factor(posterior);
      expected.row(r) = factor.solve(said.weighted + precision.cwiseProduct(now.mean)).transpose();
      uncertain.row(r) = factor.solve(Eigen::MatrixXd::Identity(P, P)).diagonal().transpose();
    }
    now.mean =
        (weights.array() * expected.array()).colwise().sum() / weights.array().colwise().sum();
    const Eigen::MatrixXd off = expected.rowwise() - now.mean.transpose();
    const Eigen::MatrixXd square = off.cwiseAbs2() + uncertain;
    now.variance = shrunk((weights.array() * square.array()).colwise().sum().transpose(), now.mean,
                          static_cast<double>(n), kinds);
    weights = (kTails + 1) / (kTails + square.array().rowwise() / now.variance.transpose().array());
    now.deviations = off;
  }
  return now;
}

Eigen::MatrixXd correlation_of(const Eigen::MatrixXd& deviations) {
  const Index P = deviations.cols();
  const Eigen::MatrixXd covariance = deviations.transpose() * deviations;
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseMax(1e-300);
  Eigen::MatrixXd correlation = covariance.cwiseQuotient(scale * scale.transpose());
  correlation *= static_cast<double>(deviations.rows()) /
                 (static_cast<double>(deviations.rows()) + kCorrelated);
  correlation.diagonal() = Eigen::VectorXd::Ones(P);
  return correlation;
}

}  // namespace

double FleetParameter::next_stddev() const {
  constexpr double kNormalOverStudent =
      1.45;  // variance of normal values over the square of the scale that is learned
  const double n = std::max(robots, 2);
  return spread * std::sqrt(kNormalOverStudent * (n + 1) / (n - 1) * (1 + 1 / n));
}

double two_sided(double t, double freedom) {
  return Eigen::numext::betainc(0.5 * freedom, 0.5, freedom / (freedom + t * t));
}

const FleetParameter* FleetPrior::find(const std::string& name) const {
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const auto& one) { return one.name == name; });
  return found == parameters.end() ? nullptr : &*found;
}

bool same_type(const Chain& one, const Chain& other) {
  if (one.name() != other.name() || one.size() != other.size()) return false;
  for (int i = 0; i < one.size(); ++i) {
    const LinkGeometry& a = one.joint(i).link;
    const LinkGeometry& b = other.joint(i).link;
    const bool same = a.theta == b.theta && a.d == b.d && a.a == b.a && a.alpha == b.alpha &&
                      a.beta == b.beta && one.joint(i).type == other.joint(i).type &&
                      one.joint(i).sign == other.joint(i).sign;
    if (!same) return false;
  }
  return true;
}

Result<FleetPrior> learn_fleet_prior(const Chain& robot, const std::vector<FleetMember>& members) {
  std::vector<const ModelParts*> twins;
  std::set<std::string> common;
  for (const FleetMember& member : members) {
    const ModelParts& parts = member.model.parts();
    if (!same_type(parts.physics.cell->robot, robot)) continue;
    std::set<std::string> own;
    for (const auto& [name, place] : arm_parameters(parts.physics)) {
      if (twins.empty() || common.contains(name)) own.insert(name);
    }
    if (own.empty()) continue;  // a model without an arm of its own contributes nothing
    common = std::move(own);
    twins.push_back(&parts);
  }
  if (static_cast<int>(twins.size()) < kFewestTwins) {
    return refused("{} trained robots of type {} to learn from, at least {} are needed",
                   twins.size(), robot.name(), kFewestTwins)
        .of("prior")
        .beyond(twins.size(), kFewestTwins);
  }
  const std::vector<std::string> names(common.begin(), common.end());
  const std::vector<Parameter> known = twins.front()->physics.parameters();
  const std::map<std::string, Index> first = arm_parameters(twins.front()->physics);
  Eigen::VectorXd scale(static_cast<Index>(names.size()));
  std::vector<Kind> kinds;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const Parameter& parameter = known[static_cast<std::size_t>(first.at(names[k]))];
    scale(static_cast<Index>(k)) = parameter.prior_scale;
    kinds.push_back({parameter.unit, parameter.lower == 0});
  }
  std::vector<Said> said;
  for (const ModelParts* parts : twins) {
    const std::map<std::string, Index> places = arm_parameters(parts->physics);
    std::vector<Index> at;
    for (const std::string& name : names) at.push_back(places.at(name));
    said.push_back(said_by(*parts, at, scale));
  }
  const Learned learned = learned_from(said, kinds);
  FleetPrior prior;
  prior.robot = robot.name();
  prior.robots = static_cast<int>(twins.size());
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto at = static_cast<Index>(k);
    prior.parameters.push_back({names[k], learned.mean(at) * scale(at),
                                std::sqrt(learned.variance(at)) * scale(at), prior.robots});
  }
  prior.correlation = correlation_of(learned.deviations);
  return prior;
}

std::vector<Unlike> unlike_twins(const std::vector<IdentifiedParameter>& parameters,
                                 const Eigen::MatrixXd& covariance, const FleetPrior& fleet) {
  std::vector<Unlike> all;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const IdentifiedParameter& one = parameters[k];
    const FleetParameter* twin = fleet.find(one.parameter.name);
    if (twin == nullptr || one.parameter.is_place) continue;
    // Its posterior without its own prior, everything else unchanged: the cavity of expectation
    // propagation.
    const double posterior = 1 / covariance(static_cast<Index>(k), static_cast<Index>(k));
    const double prior = 1 / (one.parameter.prior_scale * one.parameter.prior_scale);
    const double said = posterior - prior;
    if (said < 1e-3 * posterior) continue;
    const double value = (posterior * one.value - prior * one.parameter.prior) / said;
    const double stddev = twin->next_stddev();
    const double z = (value - twin->mean) / std::sqrt(1 / said + stddev * stddev);
    const double asked = static_cast<double>(fleet.parameters.size()) * (fleet.robots + 1);
    if (asked * two_sided(z, std::max(1, fleet.robots - 1)) > kFalseFleets) continue;
    const double scale = one.parameter.scale;
    all.push_back({one.parameter.name, one.parameter.unit, value * scale, twin->mean * scale,
                   stddev * scale, z});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Unlike& a, const Unlike& b) { return std::abs(a.z) > std::abs(b.z); });
  return all;
}

std::vector<Unlike> unlike_twins(const ModelParts& parts, const FleetPrior& fleet) {
  return unlike_twins(parts.parameters, parts.covariance, fleet);
}

std::string to_string(const Unlike& unlike) {
  const auto [scale, unit] = reading_of(unlike.unit);
  return fmt::format("{} is {:.4g} {}, its twins have {:.4g} ± {:.2g} ({:.1f} standard deviations)",
                     unlike.parameter, scale * unlike.value, unit, scale * unlike.fleet_mean,
                     2 * scale * unlike.fleet_stddev, unlike.z);
}

}  // namespace trammel
