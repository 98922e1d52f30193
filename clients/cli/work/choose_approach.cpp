#include "clients/cli/work/choose_approach.h"

#include <limits>
#include <utility>

#include "server/base/units.h"
#include "server/exchange/si.h"
#include "server/robot/free_turn.h"

namespace trammel::cli {

namespace {

constexpr double kWorthATurn = 0.9;  // of the sigma without

/// Turns all targets in the same sense, step by step. Each step begins at the joints of the
/// previous one. If a target cannot be reached in its own orientation, the turns continue until it
/// is reached.
Status turn_one_way(const cam::AskTargets& ask, const Chain& robot, int way,
                    const std::vector<exchange::AskedTarget>& as_asked,
                    std::vector<exchange::AskedTarget>& targets, Corrections& corrections) {
  std::vector<exchange::AskedTarget> at = as_asked;
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!at[i].joint_target) open.push_back(i);
  }
  for (int step = 1; step <= kFreeTurns && !open.empty(); ++step) {
    std::vector<exchange::AskedTarget> turned;
    for (const std::size_t i : open) {
      at[i].pose = exchange::from_si(turned_freely(exchange::to_si(as_asked[i].pose), way * step));
      turned.push_back(at[i]);
    }
    const std::vector<exchange::CorrectedTarget> items = TRY(ask(turned));
    std::vector<std::size_t> on;
    for (std::size_t n = 0; n < open.size(); ++n) {
      const std::size_t i = open[n];
      const exchange::CorrectedTarget& item = items[n];
      exchange::CorrectedTarget& best = corrections.items[i];
      if (cam::is_answered(item) || !cam::is_answered(best)) on.push_back(i);
      if (!cam::is_answered(item)) continue;
      const JointVector q = exchange::si_from_degrees(item.joints_deg, robot);
      if (!at[i].conf) at[i].seed_rad = exchange::asked_from_si(q, exchange::rails_of(robot));
      const bool better = !cam::is_answered(best) || (item.sigma_mm < kWorthATurn * best.sigma_mm &&
                                                      (item.status == "ok" || best.status != "ok"));
      if (!better || !stands_clear(robot, q)) continue;
      best = item;
      targets[i] = turned[n];
      corrections.turned_deg[i] = to_deg(way * step * kFreeTurn);
    }
    open = std::move(on);
  }
  return {};
}

/// A point of a lead-in as a target that is commanded.
exchange::CorrectedTarget lead_in_point(const Chain& robot, const JointVector& q,
                                        const Pose& X_FT) {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  exchange::CorrectedTarget point;
  point.status = "lead_in";
  point.commanded = exchange::from_si(robot.flange_pose(q) * X_FT);
  point.joints_deg = exchange::degrees_from_si(q, exchange::rails_of(robot));
  point.error_before_mm = point.error_after_mm = point.sigma_mm = kNotKnown;
  point.sigma_measured_mm = point.turn_before_deg = point.turn_after_deg = kNotKnown;
  return point;
}

}  // namespace

Status turn_freely(const cam::AskTargets& ask, const Chain& robot,
                   std::vector<exchange::AskedTarget>& targets, Corrections& corrections) {
  corrections.turned_deg.assign(targets.size(), 0);
  const std::vector<exchange::AskedTarget> as_asked = targets;
  for (const int way : {1, -1}) {
    TRY(turn_one_way(ask, robot, way, as_asked, targets, corrections));
  }
  return {};
}

Status lead_in_where_needed(const cam::AskTargets& ask, const Chain& robot, const Pose& X_FT,
                            const cam::LeadInOptions& options,
                            const std::vector<exchange::AskedTarget>& targets,
                            Corrections& corrections) {
  const cam::FindWay find_way = [&](std::size_t i,
                                    const exchange::CorrectedTarget& item) -> cam::LeadInFound {
    if (!targets[i].approach.directions.empty()) return {{}, "its side of approach is said"};
    const JointVector q = exchange::si_from_degrees(item.joints_deg, robot);
    if (auto way = lead_in(robot, q, X_FT, options.take_ups)) return {std::move(way), ""};
    return {{}, "a limit or a singular place is in the way"};
  };
  const std::vector<cam::LeadInFound> found =
      TRY(cam::lead_in_where_needed(options, targets, ask, find_way, corrections.items));
  corrections.lead_ins.resize(targets.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    exchange::CorrectedTarget& item = corrections.items[i];
    cam::tell_no_lead_in(found[i], item.message);
    if (!found[i].way) continue;
    const JointVector q = exchange::si_from_degrees(item.joints_deg, robot);
    for (const JointVector& offset : found[i].way->offsets)
      corrections.lead_ins[i].push_back(lead_in_point(robot, q + offset, X_FT));
  }
  return {};
}

}  // namespace trammel::cli
