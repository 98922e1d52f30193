#include "server/compensate/work_asked.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/compensate/known_rows.h"

namespace trammel {
namespace {

constexpr std::size_t kFarthest = 5;
constexpr std::size_t kNext = 12;
constexpr double kNear = 0.1;  // of the joints' ranges at work, in every joint: a pose this near
                               // gives the same information

std::vector<PoseContext> known_to(const CompensatedModel& in_force, const CompensatedModel* other,
                                  const std::vector<PoseContext>& poses) {
  std::vector<PoseContext> known;
  for (const PoseContext& pose : poses) {
    Measurement asked;
    asked.context = pose;
    if (knows(in_force, asked) && (other == nullptr || knows(*other, asked))) known.push_back(pose);
  }
  return known;
}

PromisedAtWork promised(const std::vector<ErrorPrediction>& predictions) {
  PromisedAtWork promised;
  double square = 0;
  for (const ErrorPrediction& one : predictions) {
    promised.out_of_domain += one.in_domain ? 0 : 1;
    square += one.true_stddev_B.squaredNorm();
  }
  promised.rms = std::sqrt(square / static_cast<double>(predictions.size()));
  return promised;
}

void compare(const std::vector<PoseContext>& poses, const std::vector<ErrorPrediction>& now,
             const std::vector<ErrorPrediction>& then, WorkAsked& work) {
  double square = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double step =
        (then[i].X_BT_predicted.translation() - now[i].X_BT_predicted.translation()).norm();
    square += step * step;
    work.farthest.push_back({poses[i], step});
  }
  std::stable_sort(work.farthest.begin(), work.farthest.end(),
                   [](const auto& a, const auto& b) { return a.difference > b.difference; });
  work.difference_rms = std::sqrt(square / static_cast<double>(poses.size()));
  work.difference_max = work.farthest.front().difference;
  work.farthest.resize(std::min(work.farthest.size(), kFarthest));
}

/// The least certain poses first, without those near an earlier choice.
std::vector<PoseContext> least_sure(const std::vector<PoseContext>& poses,
                                    const std::vector<ErrorPrediction>& predictions) {
  JointVector low = poses.front().q, high = low;
  for (const PoseContext& pose : poses) {
    low = low.cwiseMin(pose.q);
    high = high.cwiseMax(pose.q);
  }
  const JointVector near = kNear * (high - low).cwiseMax(1e-6);
  std::vector<std::size_t> order(poses.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return predictions[a].true_stddev_B.norm() > predictions[b].true_stddev_B.norm();
  });
  std::vector<PoseContext> chosen;
  for (const std::size_t i : order) {
    const bool told = std::any_of(chosen.begin(), chosen.end(), [&](const PoseContext& other) {
      return ((other.q - poses[i].q).cwiseAbs().array() <= near.array()).all();
    });
    if (!told) chosen.push_back(poses[i]);
    if (chosen.size() == kNext) break;
  }
  return chosen;
}

}  // namespace

WorkAsked work_asked(const CompensatedModel& in_force, const CompensatedModel* other,
                     const std::vector<PoseContext>& poses) {
  const std::vector<PoseContext> known = known_to(in_force, other, poses);
  WorkAsked work;
  work.poses = static_cast<int>(known.size());
  if (known.empty()) return work;
  const std::vector<ErrorPrediction> now = in_force.predict_all(known);
  work.in_force = promised(now);
  work.measure_next = least_sure(known, now);
  if (other == nullptr) return work;
  const std::vector<ErrorPrediction> then = other->predict_all(known);
  work.other = promised(then);
  compare(known, now, then, work);
  return work;
}

}  // namespace trammel
