#include "server/calibrate/maps/learned_maps.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/maps/map_evidence.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSameAngle = 1e-4;  // rad: nearer ones tell nothing of finer harmonics
constexpr int kFewestHarmonics = 4;  // for a joint without a map: enough to learn that it has none
constexpr int kMostOfAll = 580;      // harmonics of all joints together, a limit for the size of a
                                     // model and the time of a calibration
constexpr double kNoLoss = 0.5;      // nat: by which fewer harmonics may be less likely
constexpr double kMoreLoss = 1.5;  // factor on the allowed loss, repeated while there are too many
                                   // harmonics
constexpr double kFirstStep = 0.02;  // initial inverse curvature
constexpr double kSettled = 0.05;    // nat

/// One search, which starts at the end of the previous one; the second uses the outliers that the
/// maps leave.
struct Pass {
  int harmonics, evaluations;
};
constexpr Pass kPasses[] = {{48, 50}, {kMostHarmonics, 30}};

/// The number of harmonics that the different angles in their range can determine.
int most_harmonics(const Chain& robot, const MeasurementBatch& batch, int joint) {
  std::vector<double> angles;
  for (const Measurement& m : batch.measurements)
    angles.push_back(robot.gear_angles(m.context.q)(joint));
  std::sort(angles.begin(), angles.end());
  const double range = angles.back() - angles.front();
  const auto same = [](double a, double b) { return b - a < kSameAngle; };
  angles.erase(std::unique(angles.begin(), angles.end(), same), angles.end());
  const double told = static_cast<double>(angles.size()) * kPi / std::max(range, kSameAngle);
  return std::clamp(static_cast<int>(std::min(told, 1e4)), kFewestHarmonics, kMostHarmonics);
}

/// The columns of the maps of these joints among the parameters, joint by joint.
std::vector<MapColumns> columns_of(const PhysicalModel& model,
                                   const std::map<int, std::string>& spelling) {
  std::vector<MapColumns> maps;
  for (const auto& [joint, name] : spelling) {
    Index first = 0;
    for (const ErrorSourcePtr& source : model.sources) {
      const auto count = static_cast<Index>(source->parameters().size());
      if (source->name() == name) maps.push_back({first, static_cast<int>(count / 2)});
      first += count;
    }
  }
  return maps;
}

/// Takes the source out of the model; returns its values.
VectorXd taken_out(PhysicalModel& model, const std::string& name) {
  Index first = 0;
  auto source = model.sources.begin();
  for (; (*source)->name() != name; ++source)
    first += static_cast<Index>((*source)->parameters().size());
  const auto count = static_cast<Index>((*source)->parameters().size());
  const VectorXd values = model.values.segment(first, count);
  const VectorXd after = model.values.tail(model.values.size() - first - count);
  model.values.conservativeResize(model.values.size() - count);
  model.values.tail(after.size()) = after;
  model.sources.erase(source);
  return values;
}

/// log evidence(all harmonics) - log evidence(the first n), for n = 0, 1, ...: the posterior and
/// the prior of the rest at 0 (Savage and Dickey).
VectorXd loss_without(const MapEvidence::Posterior& found, const VectorXd& prior_variance,
                      const MapColumns& map) {
  const Index count = 2 * map.harmonics;
  const MatrixXd finest_first = found.covariance.block(map.first, map.first, count, count)
                                    .colwise()
                                    .reverse()
                                    .rowwise()
                                    .reverse();
  const VectorXd value = found.x.segment(map.first, count).reverse();
  const Eigen::LLT<MatrixXd> factor(finest_first);
  const MatrixXd L = factor.matrixL();
  const VectorXd whitened = factor.matrixL().solve(value);
  VectorXd loss = VectorXd::Zero(map.harmonics + 1);
  double sum = 0;
  for (Index k = 0; k < count; ++k) {
    sum += std::log(L(k, k)) - 0.5 * std::log(prior_variance(count - 1 - k)) +
           0.5 * whitened(k) * whitened(k);
    if (k % 2 == 1) loss(map.harmonics - 1 - k / 2) = sum;
  }
  return loss;
}

/// The fewest harmonics whose likelihood is less by at most `allowed`, whatever larger numbers
/// would gain.
int fewest(const VectorXd& loss, double allowed) {
  Index n = loss.size() - 1;
  while (n > kFewestHarmonics && !(loss(n - 1) > allowed)) --n;
  return static_cast<int>(n);
}

std::vector<int> orders(const std::vector<VectorXd>& losses) {
  std::vector<int> orders(losses.size());
  for (double allowed = kNoLoss;; allowed *= kMoreLoss) {
    int all = 0;
    for (std::size_t k = 0; k < losses.size(); ++k) all += orders[k] = fewest(losses[k], allowed);
    if (all <= kMostOfAll) return orders;
  }
}

/// The discrepancy that makes a sigma `factor` times larger.
double discrepancy_for(double factor, double sigma, double discrepancy) {
  const double square =
      factor * factor * (sigma * sigma + discrepancy * discrepancy) - sigma * sigma;
  return std::sqrt(std::max(0.0, square));
}

VectorXd variances(const MapSpectrum& spectrum, const VectorXd& scale) {
  VectorXd variance(2 * spectrum.harmonics);
  for (Index k = 0; k < variance.size(); ++k)
    variance(k) = std::pow(spectrum.stddev(static_cast<int>(k / 2) + 1) / scale(k), 2);
  return variance;
}

/// Learns from the equations about where the last pass ended, at first with few harmonics.
class MapSearch {
 public:
  MapSearch(const CalibrationResult& without, const MeasurementBatch& batch,
            const std::vector<int>& joints)
      : problem_{without.model, aligned(batch, without.sessions, without.model.cell->tracker)},
        weights_(weights_of(without, batch)) {
    for (const int joint : joints)
      most_[joint] = most_harmonics(without.model.cell->robot, batch, joint);
  }

  std::map<int, MapSpectrum> run(int most) {
    for (const Pass& one : kPasses) {
      set_harmonics(std::min(one.harmonics, most));
      pass(one.evaluations);
    }
    return learned_;
  }

 private:
  /// Limits each map to `most` harmonics; harmonics that remain keep their values.
  void set_harmonics(int most) {
    PhysicalModel& model = problem_.model;
    std::map<int, VectorXd> before;
    for (auto& [joint, name] : spelling_) before[joint] = taken_out(model, name);
    for (const auto& [joint, told] : most_) {
      spelling_[joint] = spelled_map(joint, {.harmonics = std::min(most, told)});
      const Index first =
          add_source(model, make_error_source(spelling_[joint], *model.cell).value());
      model.values.segment(first, before[joint].size()) = before[joint];
    }
    maps_ = columns_of(model, spelling_);
  }

  void pass(int evaluations) {
    const LinearArm arm = linear_arm(problem_, weights_);
    const MapEvidence evidence(arm, maps_);
    if (logs_.size() == 0) logs_ = evidence.start();
    logs_.tail(2).setZero();
    logs_ = most_probable(evidence, evaluations);
    const MapEvidence::Posterior found = evidence.posterior(logs_);
    take_spectra(evidence, found, arm.scaled.scale);
    problem_.model.values = arm.scaled.values_at(found.x.cwiseMax(arm.scaled.lower()));
    const Tracker& tracker = problem_.model.cell->tracker;
    const auto [places, turns] = evidence.noise(logs_);
    weights_.discrepancy = discrepancy_for(places, tracker.sigma, weights_.discrepancy);
    if (weights_.of_pose > 0)
      weights_.of_pose = discrepancy_for(places, tracker.sigma, weights_.of_pose);
    weights_.discrepancy_rotation =
        discrepancy_for(turns, tracker.sigma_rotation, weights_.discrepancy_rotation);
  }

  [[nodiscard]] VectorXd most_probable(const MapEvidence& evidence, int evaluations) const {
    const Objective objective = [&](const VectorXd& x, ObjectiveValue* out) {
      return evidence(x, out);
    };
    const MatrixXd inverse_curvature = kFirstStep * MatrixXd::Identity(logs_.size(), logs_.size());
    const BfgsResult best = minimise(objective, logs_, inverse_curvature,
                                     {.max_evaluations = evaluations, .tolerance = kSettled});
    return best.defined ? best.x : logs_;
  }

  void take_spectra(const MapEvidence& evidence, const MapEvidence::Posterior& found,
                    const VectorXd& scale) {
    std::vector<VectorXd> losses;
    for (std::size_t k = 0; k < maps_.size(); ++k) {
      const VectorXd own_scale = scale.segment(maps_[k].first, 2 * maps_[k].harmonics);
      losses.push_back(
          loss_without(found, variances(evidence.spectrum(logs_, k), own_scale), maps_[k]));
    }
    const std::vector<int> order = orders(losses);
    std::size_t k = 0;
    for (const auto& [joint, name] : spelling_) {
      learned_[joint] = evidence.spectrum(logs_, k);
      learned_[joint].harmonics = order[k++];
    }
  }

  CalibrationProblem problem_;
  Weights weights_;
  std::map<int, int> most_;  // harmonics that the poses determine
  std::map<int, std::string> spelling_;
  std::vector<MapColumns> maps_;
  VectorXd logs_;
  std::map<int, MapSpectrum> learned_;
};

}  // namespace

std::map<int, MapSpectrum> learned_maps(const CalibrationResult& without,
                                        const MeasurementBatch& batch,
                                        const std::vector<int>& joints, int most) {
  return MapSearch(without, batch, joints).run(most);
}

}  // namespace trammel
