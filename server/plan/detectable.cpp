#include "server/plan/detectable.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/numerics/chi_square.h"
#include "server/numerics/seeded_random.h"

namespace trammel {

namespace {

using Eigen::Index;

constexpr int kDirections = 24;        // of a cause of several numbers
constexpr double kLeastEffect = 1e-7;  // m, of one prior scale: below it is rounding
constexpr double kLeastShare = 0.01;   // of an effect: less is a motion of base and tool
constexpr double kLowestOrder = 1, kHighestOrder = 120;  // cycles a turn, of a function of an angle

/// A number of the normal distribution, by Box and Muller.
double normal(SeededRandom& random) {
  const double radius = std::sqrt(-2 * std::log(random.uniform(1e-300, 1)));
  return radius * std::cos(2 * kPi * random.uniform(0, 1));
}

Eigen::MatrixXd span_of(const Eigen::MatrixXd& columns) {
  if (columns.cols() == 0) return columns;
  Eigen::MatrixXd scaled = columns;
  for (auto column : scaled.colwise()) column /= std::max(column.norm(), kLeastEffect);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  qr.setThreshold(1e-9);
  return qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), qr.rank());
}

}  // namespace

Vector6 signal_at(const CauseSignal& signal, const CauseEffects& effects, const PoseEffects& at,
                  const JointVector& q) {
  const SingleCause& cause = effects.causes()[signal.cause].cause;
  const double shape =
      cause.any_function ? std::sin(signal.order * q(cause.joint) + signal.phase) : 1.0;
  return shape * (at.by_cause * signal.weights);
}

WorkingPoses::WorkingPoses(const CauseEffects& effects, const std::vector<PoseContext>& poses,
                           bool new_tool)
    : poses_(poses) {
  const auto rows = 3 * static_cast<Index>(poses.size());
  by_cause_.resize(rows, effects.size());
  const auto tool = static_cast<Index>(new_tool ? effects.tool_columns().size() : 0);
  Eigen::MatrixXd frames(rows, 6 + tool);
  for (Index i = 0; 3 * i < rows; ++i) {
    const PoseEffects at = effects.at(poses[static_cast<std::size_t>(i)]);
    by_cause_.middleRows<3>(3 * i) = at.by_cause.topRows<3>();
    frames.block<3, 6>(3 * i, 0) = at.by_base.topRows<3>();
  }
  if (tool > 0) frames.rightCols(tool) = by_cause_(Eigen::all, effects.tool_columns());
  frames_ = span_of(frames);
}

double WorkingPoses::left_rms(const Eigen::VectorXd& effect) const {
  const Eigen::VectorXd left = effect - frames_ * (frames_.transpose() * effect);
  return left.norm() / std::sqrt(static_cast<double>(poses_.size()));
}

Eigen::MatrixXd WorkingPoses::left_square(const std::vector<Index>& columns) const {
  Eigen::MatrixXd left = by_cause_(Eigen::all, columns);
  left -= frames_ * (frames_.transpose() * left).eval();
  return left.transpose() * left / static_cast<double>(poses_.size());
}

double WorkingPoses::any_function_rms(Index column) const {
  return by_cause_.col(column).norm() / std::sqrt(static_cast<double>(poses_.size()));
}

Eigen::VectorXd WorkingPoses::effect(const CauseSignal& signal, Index joint) const {
  Eigen::VectorXd moved = by_cause_ * signal.weights;
  for (Index i = 0; joint >= 0 && 3 * i < moved.size(); ++i)
    moved.segment<3>(3 * i) *=
        std::sin(signal.order * poses_[static_cast<std::size_t>(i)].q(joint) + signal.phase);
  return moved;
}

bool WorkingPoses::scaled_to_one(CauseSignal& signal, Index joint) const {
  const Eigen::VectorXd whole = effect(signal, joint);
  const double left = left_rms(whole);
  const double all = whole.norm() / std::sqrt(static_cast<double>(poses_.size()));
  if (left < kLeastEffect || left < kLeastShare * all) return false;
  signal.weights /= left;
  return true;
}

void WorkingPoses::add_signals(const CauseEffects& effects, std::size_t cause, std::uint64_t seed,
                               std::vector<CauseSignal>& all) const {
  const CauseEffects::Entry& entry = effects.causes()[cause];
  const bool any = entry.cause.any_function;
  SeededRandom random(seed * 1000003 + cause);
  for (int i = 0; i < (any || entry.columns.size() > 1 ? kDirections : 1); ++i) {
    CauseSignal signal{cause, Eigen::VectorXd::Zero(by_cause_.cols()), 0, 0};
    if (any) {
      signal.order = std::exp(random.uniform(std::log(kLowestOrder), std::log(kHighestOrder)));
      signal.phase = random.uniform(0, 2 * kPi);
    }
    for (const Index column : entry.columns)
      signal.weights(column) = entry.columns.size() == 1 ? 1 : normal(random);
    if (scaled_to_one(signal, any ? entry.cause.joint : -1)) all.push_back(std::move(signal));
  }
}

std::vector<CauseSignal> WorkingPoses::signals(const CauseEffects& effects,
                                               std::uint64_t seed) const {
  std::vector<CauseSignal> all;
  for (std::size_t cause = 0; cause < effects.causes().size(); ++cause)
    add_signals(effects, cause, seed, all);
  return all;
}

std::optional<double> smallest_seen(const std::vector<double>& strengths, int freedom,
                                    double false_alarm, double power) {
  if (strengths.empty() || freedom < 1) return std::nullopt;
  const double limit = chi_square_limit(false_alarm, freedom);
  const auto seen = [&](double size) {
    double sum = 0;
    for (const double strength : strengths)
      sum += chi_square_tail(limit, freedom, size * size * strength);
    return sum / static_cast<double>(strengths.size()) >= power;
  };
  constexpr double kLargest = 1;  // m
  double low = 1e-9, high = 1e-6;
  while (high < kLargest && !seen(high)) low = high, high *= 2;
  if (high >= kLargest) return std::nullopt;
  for (int i = 0; i < 30; ++i) {
    const double middle = std::sqrt(low * high);
    (seen(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace trammel
