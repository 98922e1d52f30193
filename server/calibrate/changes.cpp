#include "server/calibrate/changes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "server/calibrate/change_kinds.h"
#include "server/calibrate/identify/weighted_pose.h"
#include "server/calibrate/sessions/session_blocks.h"
#include "server/measurement/sessions.h"
#include "server/numerics/chi_square.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kChance = 1e-4;  // of a false change, in all sessions together
constexpr double kAsGood = 9.2;   // twice the log likelihood: 1 in 100
constexpr double kLeastSeen =
    1;  // information of a candidate, prior units: below it these poses do not show it
constexpr double kLeastInflation = 1;
constexpr std::size_t kFewestToWander = 4;  // sessions
constexpr double kSlowest = 1e-4;           // prior standard deviations a session
constexpr int kRates = 60;

/// The normal equations of some rows of one session. They concern the changes (K), the shared
/// parameters (P) and the motion of the session.
struct Sums {
  MatrixXd own, shared, motion;  // K x K, K x P, K x 7
  VectorXd gradient;             // K

  Sums(Index K, Index P)
      : own(MatrixXd::Zero(K, K)),
        shared(MatrixXd::Zero(K, P)),
        motion(MatrixXd::Zero(K, kOfSession)),
        gradient(VectorXd::Zero(K)) {}
  void add(const MatrixXd& E, const MatrixXd& J, const MatrixXd& D, const VectorXd& r) {
    own.noalias() += E * E.transpose();
    shared.noalias() += E * J.transpose();
    motion.noalias() += E * D.transpose();
    gradient.noalias() += E * r;
  }
};

/// Sums with the motions eliminated, over any sessions.
struct Seen {
  MatrixXd own, shared;
  VectorXd gradient;

  void add(const Sums& sums, const SessionBlock* block) {
    if (own.size() == 0) {
      own = MatrixXd::Zero(sums.own.rows(), sums.own.cols());
      shared = MatrixXd::Zero(sums.shared.rows(), sums.shared.cols());
      gradient = VectorXd::Zero(sums.gradient.size());
    }
    own += sums.own;
    shared += sums.shared;
    gradient += sums.gradient;
    if (block == nullptr) return;
    const MatrixXd across = block->solve(sums.motion.transpose());  // 7 x K
    own.noalias() -= sums.motion * across;
    shared.noalias() -= across.transpose() * block->cross;
    gradient.noalias() -= across.transpose() * block->gradient;
  }
};

/// The equations of a whole batch beside one calibration.
class ChangeSearch {
 public:
  ChangeSearch(const CalibrationResult& found, std::vector<SessionSetting> sessions,
               const MeasurementBatch& batch)
      : kinds_(found.model, ChangesOf::kArm),
        sessions_(std::move(sessions)),
        s_(scaled_parameters(kinds_.probe(), {})),
        own_(kinds_.own()),
        changes_(kinds_.changes()),
        joints_(static_cast<std::size_t>(found.model.cell->robot.size())),
        calm_(sessions_.size(), true),
        blocks_(sessions_.size() - 1) {
    const auto P = static_cast<Index>(own_.size());
    const auto K = static_cast<Index>(changes_.size());
    for (std::size_t s = 0; s < sessions_.size(); ++s) calm_[s] = sessions_[s] == found.sessions[s];
    information_ = MatrixXd::Identity(P, P);
    for (SessionBlock& block : blocks_) block.cross = MatrixXd::Zero(kOfSession, P);
    whole_.assign(sessions_.size(), Sums(K, P));
    halves_.assign(joints_ * sessions_.size(), Sums(K, P));
    const Tracker& tracker = found.model.cell->tracker;
    const MeasurementBatch here = moved(batch, sessions_, tracker.sigma, tracker.sigma_rotation);
    find_middles(here);
    const Weights weights = weights_of(found, here);
    for (std::size_t row = 0; row < here.measurements.size(); ++row)
      add(here.measurements[row], weights, row);
    VectorXd at_rest =
        VectorXd::Zero(P);  // the shared parameters are where their gradient vanishes
    eliminate(blocks_, information_, at_rest);
    factor_.compute(information_);
  }

  [[nodiscard]] std::optional<Change> strongest() const {
    const double inflation = inflation_by_halves();
    std::vector<Scored> all;
    Seen seen;
    for (std::size_t s = sessions_.size() - 1; s >= 1; --s) {
      seen.add(whole_[s], block(s));
      for (const ChangeKind& kind : kinds_.kinds()) {
        const Scored scored = score(kind, s, seen, inflation);
        if (scored.gain > 0) all.push_back(scored);
      }
      add_alone(s, inflation, all);
    }
    const auto best =
        std::max_element(all.begin(), all.end(),
                         [](const Scored& a, const Scored& b) { return a.evidence < b.evidence; });
    const Wandering wandering = all_calm() ? most_wandering(inflation) : Wandering{};
    if (wandering.kind != nullptr && (best == all.end() || wandering.gain > best->gain))
      return told(wandering);
    if (best == all.end()) return std::nullopt;
    const double chance = chance_of(static_cast<int>(best->kind->count), best->gain, all.size());
    if (chance > kChance) return std::nullopt;
    Change change{spelled(*best), best->session, best->gain, chance, {}};
    for (const Scored& other : all) {
      if (&other != &*best && other.gain > best->gain - kAsGood)
        change.could_also_be.push_back(spelled(other));
    }
    return change;
  }

 private:
  struct Scored {
    const ChangeKind* kind = nullptr;
    std::size_t session = 0;
    double gain = 0, evidence = 0;
    bool alone = false;  // true: the change lasted for that session only
  };

  struct Wandering {
    const ChangeKind* kind = nullptr;
    double rate = 0, gain = 0;  // prior standard deviations a session; twice the log likelihood
  };

  static double chance_of(int freedom, double gain, std::size_t candidates) {
    return std::min(1.0, static_cast<double>(candidates) * chi_square_tail(gain, freedom));
  }

  [[nodiscard]] std::string spelled(const Scored& one) const {
    if (!one.alone) return one.kind->from(first_of(one.session));
    const std::string tool = one.kind->behind.empty() ? "+1" : one.kind->behind;
    return fmt::format("{}@{}{}+{}", one.kind->spelling, first_of(one.session) + 1, tool,
                       first_of(one.session + 1));
  }

  /// Adds a change that lasted for one session only, such as a reflector that sat elsewhere that
  /// day. In the first session it appears as a change at the second one. In the newest session it
  /// is the present place of the tool.
  void add_alone(std::size_t session, double inflation, std::vector<Scored>& all) const {
    if (session + 1 >= sessions_.size()) return;
    Seen seen;
    seen.add(whole_[session], block(session));
    for (const ChangeKind& kind : kinds_.kinds()) {
      if (kind.joint >= 0 || !kind.cause->takes_numbers) continue;  // a tool, which may be named
      Scored scored = score(kind, session, seen, inflation);
      scored.alone = true;
      if (scored.gain > 0) all.push_back(scored);
    }
  }

  /// The number for which a random walk from session to session gains most evidence, if the gain is
  /// beyond chance.
  [[nodiscard]] Wandering most_wandering(double inflation) const {
    Wandering best;
    if (sessions_.size() < kFewestToWander) return best;
    for (const ChangeKind& kind : kinds_.kinds()) {
      if (kind.count != 1) continue;
      const Wandering one = wandering_of(kind, inflation);
      if (one.gain > best.gain) best = one;
    }
    if (best.kind != nullptr && chance_of(1, best.gain, kinds_.kinds().size()) > kChance) return {};
    return best;
  }
  /// Models the parameter as summed steps: rate times z, each z of unit variance. The evidence of a
  /// rate is that of a Gaussian prior.
  [[nodiscard]] Wandering wandering_of(const ChangeKind& kind, double inflation) const {
    const auto S = static_cast<Index>(sessions_.size());
    const auto P = static_cast<Index>(own_.size());
    VectorXd own(S - 1), along(S - 1);
    MatrixXd shared(S - 1, P);
    for (Index s = 1; s < S; ++s) {
      Seen seen;
      seen.add(whole_[static_cast<std::size_t>(s)], block(static_cast<std::size_t>(s)));
      own(s - 1) = seen.own(kind.first, kind.first);
      shared.row(s - 1) = seen.shared.row(kind.first);
      along(s - 1) = seen.gradient(kind.first);
    }
    MatrixXd left = -(shared * factor_.solve(shared.transpose()));
    left.diagonal() += own;
    const MatrixXd sums = MatrixXd::Ones(S - 1, S - 1).triangularView<Eigen::Lower>();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(sums.transpose() * left * sums);
    const VectorXd strength =
        (eigen.eigenvectors().transpose() * (sums.transpose() * along)).array().square() /
        inflation;
    Wandering best{&kind, 0, 0};
    for (int k = 0; k < kRates; ++k) {
      const double variance = std::pow(kSlowest, 2 - 2.0 * k / kRates);
      double gain = 0;
      for (Index i = 0; i < strength.size(); ++i) {
        const double seen = 1 + variance * std::max(0.0, eigen.eigenvalues()(i));
        gain += variance * strength(i) / seen - std::log(seen);
      }
      if (gain > best.gain) best = {&kind, std::sqrt(variance), gain};
    }
    return best;
  }
  [[nodiscard]] Change told(const Wandering& wandering) const {
    const double scale = s_.scale(changes_[static_cast<std::size_t>(wandering.kind->first)]);
    Change change{wandering.kind->from(first_of(1)),
                  0,
                  wandering.gain,
                  chance_of(1, wandering.gain, kinds_.kinds().size()),
                  {},
                  wandering.rate * scale,
                  {}};
    for (std::size_t s = 1; s < sessions_.size(); ++s)
      change.steps.push_back(
          fmt::format("{}+{:.6f}", wandering.kind->from(first_of(s)), 1e3 * change.rate));
    change.source = change.steps.front();
    return change;
  }

  [[nodiscard]] bool all_calm() const {
    return std::find(calm_.begin(), calm_.end(), false) == calm_.end();
  }
  [[nodiscard]] int first_of(std::size_t session) const { return sessions_[session].first; }
  /// Null for the newest session, where the base itself moves.
  [[nodiscard]] const SessionBlock* block(std::size_t session) const {
    return session < blocks_.size() ? &blocks_[session] : nullptr;
  }

  /// Finds the middle of each joint in each session.
  void find_middles(const MeasurementBatch& batch) {
    std::vector<std::vector<double>> angles(joints_ * sessions_.size());
    for (const Measurement& m : batch.measurements) {
      for (std::size_t j = 0; j < joints_; ++j)
        angles[half(j, m.session)].push_back(m.context.q(static_cast<Index>(j)));
    }
    for (std::vector<double>& some : angles) {
      const auto middle = some.begin() + static_cast<std::ptrdiff_t>(some.size() / 2);
      if (!some.empty()) std::nth_element(some.begin(), middle, some.end());
      middles_.push_back(some.empty() ? 0 : *middle);
    }
  }
  [[nodiscard]] std::size_t half(std::size_t joint, int session) const {
    return joint * sessions_.size() + static_cast<std::size_t>(session);
  }

  void add(const Measurement& m, const Weights& weights, std::size_t row) {
    const WeightedPose pose(kinds_.probe(), s_, m, weights, row);
    VectorXd r(pose.size());
    MatrixXd all(s_.scale.size(), pose.size());  // one column an equation
    if (!pose.evaluate(s_.prior.data(), r.data(), all.data())) return;
    MatrixXd D = motion_columns(m, kinds_.probe().X_WB.translation(), pose.inverse_sigma(),
                                pose.inverse_rotation_sigma(), are_stretched(sessions_));
    if (const double norm = r.norm(); norm > pose.huber_limit()) {
      const double root_weight = std::sqrt(pose.huber_limit() / norm);
      r *= root_weight;
      all *= root_weight;
      D *= root_weight;
    }
    const MatrixXd J = all(own_, Eigen::all);
    const MatrixXd E = all(changes_, Eigen::all);
    information_.noalias() += J * J.transpose();
    const auto session = static_cast<std::size_t>(m.session);
    if (session < blocks_.size()) {
      blocks_[session].curvature.noalias() += D * D.transpose();
      blocks_[session].gradient.noalias() += D * r;
      blocks_[session].cross.noalias() += D * J.transpose();
    }
    whole_[session].add(E, J, D, r);
    for (std::size_t j = 0; j < joints_; ++j) {
      const std::size_t place = half(j, m.session);
      if (m.context.q(static_cast<Index>(j)) > middles_[place]) halves_[place].add(E, J, D, r);
    }
  }

  /// The gain of the columns [first, first + count) in addition to everything that is free.
  [[nodiscard]] double gain(Index first, Index count, const Seen& seen) const {
    const MatrixXd shared = seen.shared.middleRows(first, count);
    const MatrixXd explained = factor_.solve(shared.transpose());
    MatrixXd left = seen.own.block(first, first, count, count) - shared * explained;
    if (left.trace() < kLeastSeen) return 0;
    left.diagonal().array() += 1;  // the prior
    const VectorXd along = seen.gradient.segment(first, count);
    return along.dot(left.ldlt().solve(along));
  }

  [[nodiscard]] Scored score(const ChangeKind& kind, std::size_t session, const Seen& seen,
                             double inflation) const {
    const double gained = gain(kind.first, kind.count, seen) / inflation;
    double rows = 0;
    for (const SessionSetting& one : sessions_) rows += 3.0 * one.poses;
    return {&kind, session, gained, gained - static_cast<double>(kind.count) * std::log(rows)};
  }

  /// The factor by which gains exceed those of white noise: the mean gain of single numbers between
  /// halves of the poses. A session whose noise is in question is left out.
  [[nodiscard]] double inflation_by_halves() const {
    double sum = 0, count = 0;
    for (std::size_t j = 0; j < joints_; ++j) {
      Seen seen;
      for (std::size_t s = 0; s < sessions_.size(); ++s) {
        if (calm_[s]) seen.add(halves_[half(j, static_cast<int>(s))], block(s));
      }
      for (Index k = 0; k < seen.gradient.size(); ++k) {
        const double one = gain(k, 1, seen);
        if (one <= 0) continue;
        sum += one;
        ++count;
      }
    }
    return count > 0 ? std::max(kLeastInflation, sum / count) : kLeastInflation;
  }

  const ChangeKinds kinds_;
  const std::vector<SessionSetting> sessions_;
  const ScaledParameters s_;
  const std::vector<Index> own_, changes_;
  const std::size_t joints_;
  std::vector<bool> calm_;  // sessions that show by how much gains exceed those of white noise
  MatrixXd information_;    // P x P, of the shared parameters with their priors, in prior units
  std::vector<SessionBlock> blocks_;
  std::vector<Sums> whole_;   // by session
  std::vector<Sums> halves_;  // by joint and session: its poses above the middle
  std::vector<double> middles_;
  Eigen::LLT<MatrixXd> factor_;
};

}  // namespace

std::optional<Change> strongest_change(const CalibrationResult& found,
                                       const MeasurementBatch& batch) {
  if (found.sessions.size() < 2) return std::nullopt;
  return ChangeSearch(found, found.sessions, batch).strongest();
}

std::optional<Change> change_instead_of_noise(const CalibrationResult& found,
                                              const MeasurementBatch& batch) {
  std::vector<SessionSetting> sessions = found.sessions;
  for (SessionSetting& session : sessions) session.own_noise = session.own_noise_rotation = 0;
  if (sessions.size() < 2 || sessions == found.sessions) return std::nullopt;
  return ChangeSearch(found, std::move(sessions), batch).strongest();
}

}  // namespace trammel
