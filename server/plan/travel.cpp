#include "server/plan/travel.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr std::size_t kMostOrdered = 5000;   // poses: the nearest of all is looked for at each
constexpr std::size_t kMostImproved = 1000;  // likewise, each part of the way turned round in turn
constexpr int kPasses = 20;
constexpr double kGain = 1e-9;  // s: less is none

/// s: the time of the joint that takes longest.
double time_between(const Chain& robot, const JointVector& from, const JointVector& to) {
  double longest = 0;
  for (int j = 0; j < robot.size(); ++j)
    longest = std::max(longest, std::abs(to(j) - from(j)) / robot.joint(j).max_speed.value_or(1.0));
  return longest;
}

/// Poses [first, last) of a plan that stay consecutive in any order of it.
struct Stop {
  std::size_t first = 0, last = 0;
};

class Tour {
 public:
  Tour(const Chain& robot, const std::vector<PlannedPose>& poses) : robot_(robot), poses_(poses) {}

  /// Orders stops[from, to) after the one before them, if any.
  void order(std::vector<Stop>& stops, std::size_t from, std::size_t to) const {
    for (std::size_t at = std::max<std::size_t>(from, 1); at < to; ++at) {
      const auto nearest = std::min_element(stops.begin() + static_cast<std::ptrdiff_t>(at),
                                            stops.begin() + static_cast<std::ptrdiff_t>(to),
                                            [&](const Stop& a, const Stop& b) {
                                              return way(stops[at - 1], a) < way(stops[at - 1], b);
                                            });
      std::iter_swap(stops.begin() + static_cast<std::ptrdiff_t>(at), nearest);
    }
    if (to - from > kMostImproved) return;
    const std::size_t first = std::max<std::size_t>(from, 1);
    for (int pass = 0; pass < kPasses && improve(stops, first, to); ++pass) {
    }
  }

 private:
  double way(const Stop& from, const Stop& to) const {
    return time_between(robot_, poses_[from.last - 1].context.q, poses_[to.first].bump);
  }

  /// Reverses parts of the route; true if that made it shorter.
  bool improve(std::vector<Stop>& stops, std::size_t first, std::size_t to) const {
    bool better = false;
    for (std::size_t a = first; a + 1 < to; ++a) {
      // The way from a to b as it is, and turned round: approaches make it differ.
      double there = 0, back = 0;
      for (std::size_t b = a + 1; b < to; ++b) {
        there += way(stops[b - 1], stops[b]);
        back += way(stops[b], stops[b - 1]);
        double was = way(stops[a - 1], stops[a]) + there;
        double turned = way(stops[a - 1], stops[b]) + back;
        if (b + 1 < stops.size()) {
          was += way(stops[b], stops[b + 1]);
          turned += way(stops[a], stops[b + 1]);
        }
        if (turned >= was - kGain) continue;
        std::reverse(stops.begin() + static_cast<std::ptrdiff_t>(a),
                     stops.begin() + static_cast<std::ptrdiff_t>(b) + 1);
        std::swap(there, back);
        better = true;
      }
    }
    return better;
  }

  const Chain& robot_;
  const std::vector<PlannedPose>& poses_;
};

bool same_mounted(const PoseContext& a, const PoseContext& b) {
  return a.tool == b.tool && a.payload == b.payload;
}

}  // namespace

double travel_of(const Chain& robot, const Plan& plan) {
  double sum = 0;
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    if (i > 0) sum += time_between(robot, plan.poses[i - 1].context.q, plan.poses[i].bump);
    sum += time_between(robot, plan.poses[i].bump, plan.poses[i].context.q);
  }
  return sum;
}

Plan ordered_for_travel(const Chain& robot, Plan plan) {
  if (plan.poses.size() > kMostOrdered) return plan;
  std::vector<Stop> stops;
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    const bool same = i > 0 && same_mounted(plan.poses[i - 1].context, plan.poses[i].context) &&
                      plan.poses[i - 1].context.q == plan.poses[i].context.q;
    if (same) {
      stops.back().last = i + 1;
    } else {
      stops.push_back({i, i + 1});
    }
  }
  const Tour tour(robot, plan.poses);
  for (std::size_t from = 0, to = 0; from < stops.size(); from = to) {
    while (to < stops.size() &&
           same_mounted(plan.poses[stops[from].first].context, plan.poses[stops[to].first].context))
      ++to;
    tour.order(stops, from, to);
  }
  std::vector<PlannedPose> poses;
  for (const Stop& stop : stops) {
    for (std::size_t i = stop.first; i < stop.last; ++i) poses.push_back(plan.poses[i]);
  }
  plan.poses = std::move(poses);
  return plan;
}

}  // namespace trammel
