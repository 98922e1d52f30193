#include "server/calibrate/identify/own_noise.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr double kMedianOfChiSquare = 2.366;  // of 3 degrees of freedom
constexpr double kSpreadOfMedian = 1.124;     // relative standard deviation of that median, times
                                              // sqrt(n)
constexpr double kBeyondChance = 4;           // standard deviations
constexpr std::size_t kFewestPoses = 8;       // needed to estimate the noise of a session
constexpr double kSettled = 0.02;             // relative

/// The middle value. Of two middle values it is the lower one, so that the quieter of two sessions
/// is the usual one.
double lower_median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Squared residuals of one kind in units of their variance, and that variance itself, session by
/// session.
struct SquaresBySession {
  std::vector<std::vector<double>> ratio;
  std::vector<double> variance;  // sums
  std::vector<double> poses;     // joint vectors

  explicit SquaresBySession(std::size_t sessions)
      : ratio(sessions), variance(sessions, 0.0), poses(sessions, 0.0) {}
  /// Adds one row. `together`: the number of rows with its joint vector.
  void add(int session, double square, double of, int together) {
    const auto s = static_cast<std::size_t>(session);
    ratio[s].push_back(square / of);
    variance[s] += of;
    poses[s] += 1.0 / together;
  }
};

/// The variance that each session has beyond the others.
std::vector<double> beyond_others(const SquaresBySession& squares, double share) {
  const std::size_t S = squares.ratio.size();
  std::vector<double> level(S, 0.0), beyond(S, 0.0), all;
  for (std::size_t s = 0; s < S; ++s) {
    if (squares.ratio[s].size() < kFewestPoses) continue;
    level[s] = lower_median(squares.ratio[s]) / (kMedianOfChiSquare * share);
    all.insert(all.end(), squares.ratio[s].size(),
               level[s]);  // a large session has more weight in the usual level
  }
  if (all.empty()) return beyond;
  const double usual = lower_median(all);
  for (std::size_t s = 0; s < S; ++s) {
    const auto n = static_cast<double>(squares.ratio[s].size());
    if (level[s] <=
        usual * (1 + kBeyondChance * kSpreadOfMedian / std::sqrt(std::max(1.0, squares.poses[s]))))
      continue;
    beyond[s] = (level[s] - usual) * squares.variance[s] / n;
  }
  return beyond;
}

}  // namespace

void set_own_noise(const Residuals& r, const Freedom& freedom, const Weights& weights,
                   const MeasurementBatch& batch, std::vector<SessionSetting>& sessions) {
  SquaresBySession positions(sessions.size()), rotations(sessions.size());
  Eigen::Index turned = 0;
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const Measurement& m = batch.measurements[i];
    const auto at = static_cast<Eigen::Index>(i);
    const SessionSetting& session = sessions[static_cast<std::size_t>(m.session)];
    const int together = i < weights.together.size() ? weights.together[i] : 1;
    const double own = std::pow(session.own_noise, 2);
    const double rest =
        std::max(0.0, r.sigma(at) * r.sigma(at) - own) + std::pow(weights.discrepancy, 2);
    positions.add(m.session, r.position.col(at).squaredNorm(), rest, together);
    if (!m.R_WT) continue;
    const double own_turn = std::pow(session.own_noise_rotation, 2);
    const double rest_turn = std::max(0.0, std::pow(r.sigma_rotation(turned), 2) - own_turn) +
                             std::pow(weights.discrepancy_rotation, 2);
    rotations.add(m.session, r.rotation.col(turned++).squaredNorm(), rest_turn, together);
  }
  const auto share_left = [](double fitted, Eigen::Index vectors) {
    return std::max(0.1,
                    1 - fitted / (3.0 * static_cast<double>(std::max<Eigen::Index>(1, vectors))));
  };
  const std::vector<double> beyond =
      beyond_others(positions, share_left(freedom.positions, r.position.cols()));
  const std::vector<double> turns_beyond =
      beyond_others(rotations, share_left(freedom.turns, turned));
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    sessions[s].own_noise = std::sqrt(beyond[s]);
    sessions[s].own_noise_rotation = std::sqrt(turns_beyond[s]);
  }
}

bool are_as_noisy(const std::vector<SessionSetting>& now, const std::vector<SessionSetting>& before,
                  const Tracker& tracker) {
  const auto same = [](double sigma, double a, double b) {
    return std::abs(std::hypot(sigma, a) - std::hypot(sigma, b)) <= kSettled * std::hypot(sigma, a);
  };
  return std::equal(now.begin(), now.end(), before.begin(), before.end(),
                    [&](const SessionSetting& a, const SessionSetting& b) {
                      return same(tracker.sigma, a.own_noise, b.own_noise) &&
                             same(tracker.sigma_rotation, a.own_noise_rotation,
                                  b.own_noise_rotation);
                    });
}

void set_sigmas(const MeasurementBatch& batch, const Tracker& tracker, Residuals& r) {
  Eigen::Index turned = 0;
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const Measurement& m = batch.measurements[i];
    r.sigma(static_cast<Eigen::Index>(i)) = m.sigma.value_or(tracker.sigma);
    if (m.R_WT) r.sigma_rotation(turned++) = m.sigma_rotation.value_or(tracker.sigma_rotation);
  }
}

}  // namespace trammel
