#include "server/calibrate/jump.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/change_kinds.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify/weighted_pose.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"
#include "server/numerics/chi_square.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kChance = 1e-7;  // of a false jump in a batch
constexpr double kAsGood = 9.2;   // twice the log likelihood: 1 in 100
constexpr double kBeforeSlow =
    13.8;  // twice the log likelihood ratio for 1000 to 1, against slow growth
constexpr std::size_t kMostDerivatives = 2'000'000;  // poses times parameters: 100 MB of equations
constexpr std::size_t kFewestPoses = 40;             // to look at
constexpr std::size_t kFewestBeyond = 6;             // poses before a jump, and from it on
constexpr double kLeastSeen =
    1;  // information of a candidate, prior units: below it the poses do not show it
constexpr double kUsuallyLeft =
    1e-3;  // m, model error: where it is larger, a jump may be larger by the same ratio
constexpr double kLittle = 1e-6;  // share of the poses' information: a prior so weak that it hardly
                                  // shrinks a size
constexpr double kWholeBatch = 1;  // share of the batch's length: lags of slow growth
constexpr double kLags[] = {0.05, 0.1, 0.2, 0.4, kWholeBatch};
constexpr Index kWaves = 16;  // half waves over the batch, the terms of a wandering course
constexpr double kRoughness[] = {
    1, 2};  // power of the wave number that its amplitudes fall by: a walk, and smoother
constexpr double kBeforeWandering =
    4.6;  // nat, 100 to 1: the lead over the likeliest wandering course of that kind

/// The equations of one pose, in units of sigma: residual, derivatives by the free parameters (P)
/// and by the kinds (K).
struct PoseEquations {
  const Measurement* measurement;
  VectorXd residual;
  MatrixXd free, kinds;  // one column an equation
  double inverse_sigma = 0;
};

/// Normal equations of the kinds over some poses.
struct KindSums {
  MatrixXd own, shared;  // K x K, K x P
  VectorXd along;        // K

  KindSums(Index K, Index P)
      : own(MatrixXd::Zero(K, K)), shared(MatrixXd::Zero(K, P)), along(VectorXd::Zero(K)) {}
  void add(const PoseEquations& pose, double weight = 1) {
    own.noalias() += weight * weight * pose.kinds * pose.kinds.transpose();
    shared.noalias() += weight * pose.kinds * pose.free.transpose();
    along.noalias() += weight * pose.kinds * pose.residual;
  }
};

/// The part that a kind explains, and its size.
struct Fitted {
  double gain = 0;  // twice the log likelihood
  VectorXd size;    // in units of the priors
};

class JumpSearch {
 public:
  JumpSearch(const CalibrationResult& found, const std::vector<const Measurement*>& poses)
      : kinds_(found.model, ChangesOf::kArmAndInstrument),
        s_(scaled_parameters(kinds_.probe(), {})),
        own_(kinds_.own()),
        changes_(kinds_.changes()),
        prior_(std::pow(std::max(1.0, found.discrepancy / kUsuallyLeft), -2)) {
    const Weights weights{found.discrepancy, found.discrepancy_rotation, true};
    for (const Measurement* m : poses) add(*m, weights);
    free_sides();
    const Index P = poses_.empty() ? 0 : poses_.front().free.rows();
    MatrixXd information = prior_ * MatrixXd::Identity(P, P);
    for (const PoseEquations& pose : poses_)
      information.noalias() += pose.free * pose.free.transpose();
    factor_.compute(information);
    settle();
  }

  [[nodiscard]] std::optional<Jump> strongest() const {
    if (poses_.size() < kFewestPoses) return std::nullopt;
    const std::vector<Scored> seen = all_scored(inflation_by_halves());
    const auto first = strongest_of(seen);
    if (first == seen.end()) return std::nullopt;
    // A jump also makes the halves differ, so it is removed before the halves are tested for white
    // noise.
    const double inflation = without(*first).inflation_by_halves();
    const std::vector<Scored> all = all_scored(inflation);
    const auto best = strongest_of(all);
    if (best == all.end()) return std::nullopt;
    const double chance =
        std::min(1.0, static_cast<double>(all.size()) *
                          chi_square_tail(best->gain, static_cast<int>(best->kind->count)));
    if (chance > kChance || best->gain < slow_gain(*best->kind) / inflation + kBeforeSlow)
      return std::nullopt;
    if (evidence_of_jump(*best, inflation) <
        evidence_of_wandering(*best->kind, inflation) + kBeforeWandering)
      return std::nullopt;
    return told(*best, chance, all);
  }

 private:
  struct Scored {
    const ChangeKind* kind = nullptr;
    std::size_t at = 0;
    double gain = 0, evidence = 0;
    VectorXd size;
  };

  [[nodiscard]] std::vector<Scored> all_scored(double inflation) const {
    std::vector<Scored> all;
    KindSums since(kinds(), unknowns());
    for (std::size_t i = poses_.size() - 1; i >= kFewestBeyond; --i) {
      since.add(poses_[i]);
      if (poses_.size() - i < kFewestBeyond) continue;
      for (const ChangeKind& kind : kinds_.kinds()) {
        const Fitted fitted = fit(kind.first, kind.count, since);
        if (fitted.gain > 0) all.push_back(scored(kind, i, fitted, inflation));
      }
    }
    return all;
  }
  [[nodiscard]] static std::vector<Scored>::const_iterator strongest_of(
      const std::vector<Scored>& all) {
    return std::max_element(all.begin(), all.end(), [](const Scored& a, const Scored& b) {
      return a.evidence < b.evidence;
    });
  }

  /// Finds how far the free parameters still are from the minimum.
  void settle() {
    VectorXd gradient = VectorXd::Zero(factor_.rows());
    for (const PoseEquations& pose : poses_) gradient.noalias() += pose.free * pose.residual;
    at_rest_ = factor_.solve(gradient);
  }

  /// The search on these poses after subtracting the effect of the jump.
  [[nodiscard]] JumpSearch without(const Scored& jump) const {
    JumpSearch rest = *this;
    for (std::size_t i = jump.at; i < rest.poses_.size(); ++i) {
      PoseEquations& pose = rest.poses_[i];
      pose.residual -=
          pose.kinds.middleRows(jump.kind->first, jump.kind->count).transpose() * jump.size;
    }
    rest.settle();
    return rest;
  }

  [[nodiscard]] Index kinds() const { return static_cast<Index>(changes_.size()); }
  [[nodiscard]] Index unknowns() const { return poses_.front().free.rows(); }

  void add(const Measurement& m, const Weights& weights) {
    const WeightedPose weighted(kinds_.probe(), s_, m, weights);
    PoseEquations pose{&m, VectorXd(weighted.size()), {}, {}, weighted.inverse_sigma()};
    MatrixXd all(s_.scale.size(), weighted.size());
    if (!weighted.evaluate(s_.prior.data(), pose.residual.data(), all.data())) return;
    if (const double norm = pose.residual.norm(); norm > weighted.huber_limit()) {
      const double root_weight = std::sqrt(weighted.huber_limit() / norm);
      pose.residual *= root_weight;
      pose.inverse_sigma *= root_weight;
      all *= root_weight;
    }
    pose.free = all(own_, Eigen::all);
    pose.kinds = all(changes_, Eigen::all);
    poses_.push_back(std::move(pose));
  }

  /// A joint that comes from both sides may have play: its zero is another one from each.
  void free_sides() {
    for (const ChangeKind& kind : kinds_.kinds()) {
      if (kind.joint < 0) continue;
      const auto side = [&](const PoseEquations& pose) -> double {
        const auto& direction = pose.measurement->context.direction;
        const auto joint = static_cast<std::size_t>(kind.joint);
        return joint < direction.size() ? direction[joint] : 0;
      };
      const auto comes = [&](double from) {
        return std::any_of(poses_.begin(), poses_.end(),
                           [&](const auto& pose) { return side(pose) == from; });
      };
      if (!comes(1) || !comes(-1)) continue;
      for (PoseEquations& pose : poses_) {
        const MatrixXd column = side(pose) * pose.kinds.middleRows(kind.first, kind.count);
        pose.free.conservativeResize(pose.free.rows() + kind.count, Eigen::NoChange);
        pose.free.bottomRows(kind.count) = column;
      }
    }
  }

  /// `most_prior`: the largest ratio of the prior's information to that of the data.
  [[nodiscard]] Fitted fit(Index first, Index count, const KindSums& sums,
                           double most_prior = 1e12) const {
    const MatrixXd shared = sums.shared.middleRows(first, count);
    MatrixXd left =
        sums.own.block(first, first, count, count) - shared * factor_.solve(shared.transpose());
    if (left.trace() < kLeastSeen * prior_) return {};
    left.diagonal() +=
        (most_prior * left.diagonal()).cwiseMax(kLittle * prior_).cwiseMin(prior_).eval();
    const VectorXd along = sums.along.segment(first, count) - shared * at_rest_;
    const VectorXd size = left.ldlt().solve(along);
    return {along.dot(size), size};
  }

  [[nodiscard]] Scored scored(const ChangeKind& kind, std::size_t at, const Fitted& fitted,
                              double inflation) const {
    const double gain = fitted.gain / inflation;
    const double price =
        static_cast<double>(kind.count) * std::log(3.0 * static_cast<double>(poses_.size()));
    return {&kind, at, gain, gain - price, fitted.size};
  }

  /// The gain of the kind as something that grows slowly: with one of several lags, steadily, or
  /// with the temperature.
  [[nodiscard]] double slow_gain(const ChangeKind& kind) const {
    const auto n = static_cast<double>(poses_.size());
    double best = gain_with(kind, [n](std::size_t i) { return static_cast<double>(i) / n; });
    for (const double lag : kLags) {
      best = std::max(best, gain_with(kind, [n, lag](std::size_t i) {
                        return 1 - std::exp(-static_cast<double>(i) / (lag * n));
                      }));
    }
    const auto warmth = [&](std::size_t i) { return poses_[i].measurement->context.temperature; };
    double mean = 0;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!warmth(i)) return best;
      mean += *warmth(i) / n;
    }
    return std::max(best,
                    gain_with(kind, [&](std::size_t i) { return 0.1 * (*warmth(i) - mean); }));
  }
  template <typename Course>
  [[nodiscard]] double gain_with(const ChangeKind& kind, const Course& course) const {
    KindSums sums(kinds(), unknowns());
    for (std::size_t i = 0; i < poses_.size(); ++i) sums.add(poses_[i], course(i));
    return fit(kind.first, kind.count, sums).gain;
  }

  /// Nat, of a jump there, its size likely by a scale that the data choose.
  [[nodiscard]] double evidence_of_jump(const Scored& jump, double inflation) const {
    KindSums since(kinds(), unknowns());
    for (std::size_t i = jump.at; i < poses_.size(); ++i) since.add(poses_[i]);
    const Index first = jump.kind->first, count = jump.kind->count;
    const MatrixXd shared = since.shared.middleRows(first, count);
    const MatrixXd left =
        since.own.block(first, first, count, count) - shared * factor_.solve(shared.transpose());
    const VectorXd along = since.along.segment(first, count) - shared * at_rest_;
    return best_evidence(left / inflation, along / inflation, VectorXd::Ones(count)) -
           std::log(static_cast<double>(poses_.size()));
  }

  /// Nat: the evidence that the kind wanders, as half waves over the batch. The amplitudes fall by
  /// a power of the wave number, and have a scale; the data choose both.
  [[nodiscard]] double evidence_of_wandering(const ChangeKind& kind, double inflation) const {
    const Index n = static_cast<Index>(poses_.size()), count = kind.count, all = kWaves * count;
    MatrixXd own = MatrixXd::Zero(all, all), shared = MatrixXd::Zero(all, unknowns());
    VectorXd along = VectorXd::Zero(all);
    for (Index i = 0; i < n; ++i) {
      const PoseEquations& pose = poses_[static_cast<std::size_t>(i)];
      MatrixXd columns(all, pose.residual.size());
      for (Index k = 0; k < kWaves; ++k) {
        const double phase =
            static_cast<double>((k + 1) * (2 * i + 1)) / static_cast<double>(2 * n);
        columns.middleRows(k * count, count) =
            std::cos(kPi * phase) * pose.kinds.middleRows(kind.first, count);
      }
      own.noalias() += columns * columns.transpose();
      shared.noalias() += columns * pose.free.transpose();
      along.noalias() += columns * pose.residual;
    }
    own -= shared * factor_.solve(shared.transpose());
    along -= shared * at_rest_;
    double best = 0;
    for (const double power : kRoughness) {
      VectorXd amplitude(all);
      for (Index k = 0; k < all; ++k)
        amplitude(k) = std::pow(static_cast<double>(1 + k / count), -power);
      best = std::max(best, best_evidence(own / inflation, along / inflation, amplitude));
    }
    return best;
  }

  /// Nat, of numbers that are normal about nothing: standard deviations `amplitude` times the
  /// likeliest scale.
  [[nodiscard]] static double best_evidence(const MatrixXd& information, const VectorXd& along,
                                            const VectorXd& amplitude) {
    const MatrixXd scaled = amplitude.asDiagonal() * information * amplitude.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (scaled + scaled.transpose()));
    const VectorXd values = eigen.eigenvalues().cwiseMax(0.0);
    const VectorXd square =
        (eigen.eigenvectors().transpose() * amplitude.cwiseProduct(along)).cwiseAbs2();
    double best = 0;
    for (double scale = 1e-8; scale < 1e3; scale *= 2) {
      const Eigen::ArrayXd grown = 1 + scale * values.array();
      best = std::max(best, 0.5 * (scale * square.array() / grown - grown.log()).sum());
    }
    return best;
  }

  /// The factor by which gains exceed those of white noise: the mean gain of single numbers between
  /// halves of the poses, split by each joint's angle.
  [[nodiscard]] double inflation_by_halves() const {
    double sum = 0, count = 0;
    const Index joints = poses_.front().measurement->context.q.size();
    for (Index j = 0; j < joints; ++j) {
      std::vector<double> angles;
      for (const PoseEquations& pose : poses_) angles.push_back(pose.measurement->context.q(j));
      const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
      std::nth_element(angles.begin(), middle, angles.end());
      KindSums upper(kinds(), unknowns());
      for (const PoseEquations& pose : poses_)
        if (pose.measurement->context.q(j) > *middle) upper.add(pose);
      for (Index k = 0; k < kinds(); ++k) {
        const double one = fit(k, 1, upper).gain;
        if (one <= 0) continue;
        sum += one;
        ++count;
      }
    }
    return count > 0 ? std::max(1.0, sum / count) : 1.0;
  }

  [[nodiscard]] Jump told(const Scored& best, double chance, const std::vector<Scored>& all) const {
    const Measurement& begins = *poses_[best.at].measurement;
    Jump jump{best.kind->from(begins.context.index), begins.pose_id, begins.row, 0, chance, {}};
    KindSums since(kinds(), unknowns());
    for (std::size_t i = best.at; i < poses_.size(); ++i) since.add(poses_[i]);
    const VectorXd size = fit(best.kind->first, best.kind->count, since, kLittle).size;
    double square = 0;
    for (std::size_t i = best.at; i < poses_.size(); ++i) {
      const VectorXd moved =
          poses_[i].kinds.middleRows(best.kind->first, best.kind->count).transpose() * size;
      square += moved.head<3>().squaredNorm() / std::pow(poses_[i].inverse_sigma, 2);
    }
    jump.effect = std::sqrt(square / static_cast<double>(poses_.size() - best.at));
    for (const Scored& other : all) {
      if (other.kind == best.kind || other.gain < best.gain - kAsGood) continue;
      const std::string cause = other.kind->spelling + other.kind->behind;
      if (std::find(jump.could_also_be.begin(), jump.could_also_be.end(), cause) ==
          jump.could_also_be.end())
        jump.could_also_be.push_back(cause);
    }
    return jump;
  }

  const ChangeKinds kinds_;
  const ScaledParameters s_;
  const std::vector<Index> own_, changes_;
  const double prior_;  // information of a prior, 1 where the model leaves no more than usual
  std::vector<PoseEquations> poses_;
  Eigen::LLT<MatrixXd> factor_;
  VectorXd at_rest_;  // P: how far the free parameters still are from the minimum
};

/// The poses of each tool and payload.
std::vector<std::vector<const Measurement*>> by_load(const MeasurementBatch& batch) {
  std::map<std::pair<std::string, std::string>, std::vector<const Measurement*>> loads;
  for (const Measurement& m : batch.measurements)
    loads[{m.context.tool, m.context.payload}].push_back(&m);
  std::vector<std::vector<const Measurement*>> all;
  for (auto& [load, poses] : loads) all.push_back(std::move(poses));
  return all;
}

}  // namespace

std::string in_words(const Jump& jump) {
  const auto words = [](const std::string& source) {
    return in_words(source.substr(0, source.find('@')));
  };
  std::string text =
      fmt::format("from pose {} (row {}) on: {}, {:.3f} mm rms at the measured points",
                  jump.pose_id, jump.row, words(jump.source), to_mm(jump.effect));
  for (const std::string& other : jump.could_also_be) text += ", or " + words(other);
  return text;
}

std::optional<Jump> jump_within(const CalibrationResult& found, const MeasurementBatch& batch) {
  if (has_sessions(batch) || has_gauges(batch)) return std::nullopt;
  if (batch.measurements.size() * found.parameters.size() > kMostDerivatives) return std::nullopt;
  std::optional<Jump> worst;
  for (const std::vector<const Measurement*>& poses : by_load(batch)) {
    std::optional<Jump> jump = JumpSearch(found, poses).strongest();
    if (jump && (!worst || jump->p_value < worst->p_value)) worst = std::move(jump);
  }
  return worst;
}

std::optional<Jump> jump_within(const std::shared_ptr<const Cell>& cell,
                                const MeasurementBatch& batch) {
  if (has_sessions(batch) || has_gauges(batch) || batch.measurements.size() < kFewestPoses)
    return std::nullopt;
  const auto found =
      calibrate(cell, with_unknown_tool(cell->model.error_sources, *cell), batch, {});
  return found ? jump_within(*found, batch) : std::nullopt;
}

}  // namespace trammel
