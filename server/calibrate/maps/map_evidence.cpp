#include "server/calibrate/maps/map_evidence.h"

#include <cmath>
#include <optional>

#include "server/numerics/product.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kLogsOfMap = 3;

/// Priors of the logarithms: means and standard deviations.
constexpr double kTypicalRms = 1e-4;    // rad: 0.1 mm at 1 m, as gears have it
constexpr double kSpreadOfRms = 2.0;    // from a seventh to seven times as large
constexpr double kTypicalKnee = 6.0;    // harmonic: gear errors of an arm begin to fall off there
constexpr double kSpreadOfKnee = 1.0;   // from a third to three times
constexpr double kTypicalPower = 1.3;   // between amplitudes that fall as 1/h and as 1/h²
constexpr double kSpreadOfPower = 0.5;  // from 0.8 to 2.1
constexpr double kSpreadOfNoise = 3.0;  // hardly any prior

VectorXd typical_logs(std::size_t maps) {
  VectorXd logs = VectorXd::Zero(kLogsOfMap * static_cast<Index>(maps) + 2);
  const Eigen::Vector3d one(std::log(kTypicalRms), std::log(kTypicalKnee), std::log(kTypicalPower));
  logs.head(logs.size() - 2) = one.replicate(static_cast<Index>(maps), 1);
  return logs;
}

VectorXd spreads(std::size_t maps) {
  VectorXd spread = VectorXd::Constant(kLogsOfMap * static_cast<Index>(maps) + 2, kSpreadOfNoise);
  const Eigen::Vector3d one(kSpreadOfRms, kSpreadOfKnee, kSpreadOfPower);
  spread.head(spread.size() - 2) = one.replicate(static_cast<Index>(maps), 1);
  return spread;
}

/// The share of each harmonic in a map's variance, and the derivatives of the log of that share by
/// log knee and log power.
struct Shares {
  VectorXd share, by_knee, by_power;

  Shares(int harmonics, double knee, double power)
      : share(harmonics), by_knee(harmonics), by_power(harmonics) {
    for (Index k = 0; k < harmonics; ++k) {
      const double ratio = std::pow(static_cast<double>(k + 1) / knee, 2);
      share(k) = std::pow(1 + ratio, -power);
      by_knee(k) = 2 * power * ratio / (1 + ratio);
      by_power(k) = -power * std::log1p(ratio);
    }
    share /= share.sum();
    by_knee.array() -= share.dot(by_knee);
    by_power.array() -= share.dot(by_power);
  }
};

Shares shares_of(const MapColumns& map, const VectorXd& logs, Index first) {
  return {map.harmonics, std::exp(logs(first + 1)), std::exp(logs(first + 2))};
}

}  // namespace

/// With the parameters in units of their prior standard deviations: I + S (Σ information) S = L Lᵀ.
struct MapEvidence::Solved {
  VectorXd root;             // S: prior standard deviations in units of the scales
  MatrixXd inverse;          // (L Lᵀ)⁻¹
  VectorXd change;           // in units of the prior
  VectorXd before;           // from_prior_ in them
  std::array<double, 2> at;  // the factor of each kind
  double cost = 0;           // without the priors of the logarithms
};

MapEvidence::MapEvidence(const LinearArm& arm, std::vector<MapColumns> maps)
    : arm_(arm), maps_(std::move(maps)), from_prior_(VectorXd::Zero(arm.scaled.scale.size())) {
  for (const MapColumns& map : maps_)
    from_prior_.segment(map.first, 2 * map.harmonics) =
        -arm.scaled.prior.segment(map.first, 2 * map.harmonics);
}

VectorXd MapEvidence::start() const { return typical_logs(maps_.size()); }

VectorXd MapEvidence::prior_variance(const VectorXd& logs) const {
  VectorXd variance = VectorXd::Ones(from_prior_.size());
  Index first = 0;
  for (const MapColumns& map : maps_) {
    const VectorXd share = shares_of(map, logs, first).share;
    for (Index k = 0; k < 2 * map.harmonics; ++k)
      variance(map.first + k) =
          std::exp(2 * logs(first)) * share(k / 2) / std::pow(arm_.scaled.scale(map.first + k), 2);
    first += kLogsOfMap;
  }
  return variance;
}

std::optional<MapEvidence::Solved> MapEvidence::solved(const VectorXd& logs) const {
  Solved now;
  now.root = prior_variance(logs).cwiseSqrt();
  now.before = from_prior_.cwiseQuotient(now.root);
  now.at = {std::exp(logs(logs.size() - 2)), std::exp(logs(logs.size() - 1))};
  MatrixXd curvature =
      now.at[0] * arm_.kinds[0].information + now.at[1] * arm_.kinds[1].information;
  curvature = (now.root.asDiagonal() * curvature * now.root.asDiagonal()).eval();
  curvature.diagonal().array() += 1;
  const std::optional<MatrixXd> factor = inverse_factor(curvature);
  if (!factor) return std::nullopt;
  now.inverse = gram(*factor);
  const VectorXd downhill = now.root.cwiseProduct(now.at[0] * arm_.kinds[0].downhill +
                                                  now.at[1] * arm_.kinds[1].downhill) +
                            now.before;
  now.change = now.inverse * downhill;
  now.cost = 0.5 * (now.before.squaredNorm() - downhill.dot(now.change)) -
             factor->diagonal().array().log().sum();
  for (std::size_t k = 0; k < 2; ++k)
    now.cost +=
        0.5 * (now.at[k] * arm_.kinds[k].square - arm_.kinds[k].count * std::log(now.at[k]));
  return now;
}

void MapEvidence::add_slopes_of_maps(const VectorXd& logs, const Solved& at,
                                     VectorXd& gradient) const {
  // Half of: 1 less the mean square of the parameter over its prior variance.
  const VectorXd by_variance =
      0.5 * (1 - at.inverse.diagonal().array() - (at.change - at.before).array().square()).matrix();
  Index first = 0;
  for (const MapColumns& map : maps_) {
    const Shares shares = shares_of(map, logs, first);
    for (Index k = 0; k < 2 * map.harmonics; ++k) {
      const double slope = by_variance(map.first + k);
      gradient.segment<3>(first) +=
          slope * Vector3(2, shares.by_knee(k / 2), shares.by_power(k / 2));
    }
    first += kLogsOfMap;
  }
}

bool MapEvidence::operator()(const VectorXd& logs, ObjectiveValue* out) const {
  const std::optional<Solved> at = solved(logs);
  if (!at || !std::isfinite(at->cost)) return false;
  const VectorXd off = (logs - typical_logs(maps_.size())).cwiseQuotient(spreads(maps_.size()));
  out->value = at->cost + 0.5 * off.squaredNorm();
  out->gradient = off.cwiseQuotient(spreads(maps_.size()));
  add_slopes_of_maps(logs, *at, out->gradient);
  const VectorXd change = at->root.cwiseProduct(at->change);
  const MatrixXd covariance = at->root.asDiagonal() * at->inverse * at->root.asDiagonal();
  for (std::size_t k = 0; k < 2; ++k) {
    const LinearEquations& kind = arm_.kinds[k];
    const double left = kind.square - 2 * kind.downhill.dot(change) +
                        change.dot(kind.information * change) +
                        kind.information.cwiseProduct(covariance).sum();
    out->gradient(logs.size() - 2 + static_cast<Index>(k)) += 0.5 * (at->at[k] * left - kind.count);
  }
  return true;
}

MapEvidence::Posterior MapEvidence::posterior(const VectorXd& logs) const {
  const std::optional<Solved> at = solved(logs);
  if (!at) return {arm_.scaled.prior, prior_variance(logs).asDiagonal()};
  return {arm_.scaled.prior + at->root.cwiseProduct(at->change),
          at->root.asDiagonal() * at->inverse * at->root.asDiagonal()};
}

MapSpectrum MapEvidence::spectrum(const VectorXd& logs, std::size_t map) const {
  const Index first = kLogsOfMap * static_cast<Index>(map);
  MapSpectrum found;
  found.harmonics = maps_[map].harmonics;
  found.amplitude = 1;
  found.knee = std::exp(logs(first + 1));
  found.power = std::exp(logs(first + 2));
  double total = 0;
  for (int h = 1; h <= found.harmonics; ++h) total += std::pow(found.stddev(h), 2);
  found.amplitude = std::exp(logs(first)) / std::sqrt(total);
  return found;
}

std::array<double, 2> MapEvidence::noise(const VectorXd& logs) const {
  return {std::exp(-0.5 * logs(logs.size() - 2)), std::exp(-0.5 * logs(logs.size() - 1))};
}

}  // namespace trammel
