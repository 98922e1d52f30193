#include "server/diagnose/families/candidates.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;

bool any(const MeasurementBatch& batch, const std::function<bool(const PoseContext&)>& has) {
  return std::any_of(batch.measurements.begin(), batch.measurements.end(),
                     [&](const Measurement& m) { return has(m.context); });
}

bool every(const MeasurementBatch& batch, const std::function<bool(const PoseContext&)>& has) {
  return !any(batch, [&](const PoseContext& context) { return !has(context); });
}

bool approached(const MeasurementBatch& batch, int joint, int from) {
  return any(batch, [&](const PoseContext& c) {
    return !c.direction.empty() && c.direction[static_cast<std::size_t>(joint)] == from;
  });
}

double warming(const MeasurementBatch& batch) {
  double low = 1e9;
  double high = -1e9;
  for (const Measurement& m : batch.measurements) {
    if (!m.context.temperature) continue;
    low = std::min(low, *m.context.temperature);
    high = std::max(high, *m.context.temperature);
  }
  return high - low;
}

double heaviest(const Cell& cell) {
  double mass = 0;
  for (const auto& [id, payload] : cell.payloads) mass = std::max(mass, payload.mass);
  return mass;
}

/// Collects what can be looked for, and why the rest cannot.
class Possible {
 public:
  Possible(const Cell& cell, const MeasurementBatch& batch, std::vector<Unseen>* unseen)
      : cell_(cell), batch_(batch), unseen_(unseen) {}

  void take(const std::string& spec) {
    if (make_error_source(spec, cell_)) sources.push_back(spec);
  }
  void leave(const Cause& cause, const std::string& needs) const {
    if (unseen_ != nullptr) unseen_->push_back({cause, 0, {}, {}, needs});
  }
  void backlash(int joint) {
    if (!every(batch_, [](const PoseContext& c) { return !c.direction.empty(); }))
      return leave({"backlash", joint, "", "", {}}, "the approach direction of every pose (dir columns)");
    const bool up = approached(batch_, joint, 1);
    const bool down = approached(batch_, joint, -1);
    if (up && down) return take(fmt::format("backlash:{}", joint + 1));
    leave({"backlash", joint, "", "", {}}, up || down ? "approaching the poses from both sides of this joint"
                                                      : "the approach direction of each pose (dir columns), both "
                                                        "occurring");
  }
  void loads() {
    if (heaviest(cell_) <= 0) {
      return leave({"payload", -1, "", "", {}}, "a payload in the cell file, with its mass");
    }
    take("payload");
    take("payload_changed@1");
    for (int joint = 0; joint < cell_.robot.size(); ++joint) take(fmt::format("link_bending:{}", joint + 1));
  }
  void times() {
    if (every(batch_, [](const PoseContext& c) { return c.time.has_value(); })) {
      take("tracker_drift");
    } else {
      leave({"tracker_drift", -1, "", "", {}}, "the time of every pose (time_s)");
    }
    if (any(batch_, [](const PoseContext& c) { return c.velocity.has_value(); })) {
      take("time_lag");
    } else {
      leave({"time_lag", -1, "", "", {}}, "a continuous path with times (time_s)");
    }
    if (every(batch_, [](const PoseContext& c) { return c.temperature.has_value(); }) &&
        warming(batch_) > thresholds::kSameTemperature) {
      take("thermal_growth");
    } else {
      leave({"thermal_growth", -1, "", "", {}},
            "the temperature of every pose (temperature_c), differing between poses");
    }
  }

  std::vector<std::string> sources;

 private:
  const Cell& cell_;
  const MeasurementBatch& batch_;
  std::vector<Unseen>* unseen_;
};

std::string cause_name(const std::string& source) {
  const std::string name = source.substr(0, source.find_first_of(":@"));
  return name.starts_with("compliance") ? "compliance" : name;
}

/// Which causes have numbers of their own that may be lacking one by one.
bool has_single_parameters(const std::string& cause) {
  return cause == "geometry" || cause == "compliance" || cause == "payload" || cause == "wrist_coupling";
}

bool has_effect(const LinearProblem& problem, const std::string& source) {
  return std::any_of(problem.effects().begin(), problem.effects().end(),
                     [&](const Effect& effect) { return effect.source == source; });
}

std::vector<Index> all_columns(const Effect& effect) {
  std::vector<Index> all(effect.parameters.size());
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

}  // namespace

std::vector<std::string> candidate_sources(const Cell& cell, const MeasurementBatch& batch,
                                           std::vector<Unseen>* unseen) {
  Possible possible(cell, batch, unseen);
  for (const char* spec :
       {"base", "geometry", "tool", "compliance", "wrist_coupling", "tracker_moved@1", "tool_changed@1"}) {
    possible.take(spec);
  }
  for (int joint = 0; joint < cell.robot.size(); ++joint) {
    if (cell.robot.joint(joint).type == JointType::kRevolute)
      possible.take(fmt::format("encoder_eccentricity:{}", joint + 1));
    possible.backlash(joint);
  }
  possible.loads();
  possible.times();
  return possible.sources;
}

std::vector<FamilyPtr> make_families(const LinearProblem& problem) {
  std::vector<FamilyPtr> families;
  const auto add = [&](FamilyPtr family) {
    if (family) families.push_back(std::move(family));
  };
  for (const Effect& effect : problem.effects()) {
    Cause cause{cause_name(effect.source), -1, "", "", {}};
    const std::size_t colon = effect.source.find(':');
    if (colon != std::string::npos) cause.joint = std::stoi(effect.source.substr(colon + 1)) - 1;
    if (const std::size_t at = effect.source.find('@'); at != std::string::npos) {
      add(make_step_family(problem, effect, cause, effect.source.substr(0, at)));
      continue;
    }
    const double surprise =
        cause.cause == "link_bending" && has_effect(problem, "compliance") ? thresholds::kBendingFirst : 0;
    add(make_fixed_family(problem, effect, cause, all_columns(effect), surprise));
    if (!has_single_parameters(cause.cause) || effect.parameters.size() < 2) continue;
    for (std::size_t k = 0; k < effect.parameters.size(); ++k) {
      Cause single = cause;
      single.parameter = effect.parameters[k].name;
      if (cause.cause == "compliance") single.joint = static_cast<int>(k);
      add(make_fixed_family(problem, effect, single, {static_cast<Index>(k)}));
    }
  }
  const Chain& robot = problem.model().cell->robot;
  for (int joint = 0; joint < robot.size(); ++joint) {
    Effect slip{fmt::format("joint_slip:{}@1", joint + 1), {}, 2e-3 * problem.by_joint().col(joint)};
    add(make_step_family(problem, slip, {"joint_slip", joint, "", "", {}}, fmt::format("joint_slip:{}", joint + 1)));
    if (robot.joint(joint).type != JointType::kRevolute) continue;
    add(make_gear_family(problem, joint));
    add(make_joint_map_family(problem, joint));
  }
  add(make_outlier_family(problem));
  add(make_anonymous_family(problem, {}));
  for (int joint = 0; joint < robot.size(); ++joint) {
    add(make_anonymous_family(problem, {joint}));
    for (int other = joint + 1; other < robot.size(); ++other) add(make_anonymous_family(problem, {joint, other}));
  }
  return families;
}

Cause cause_of(const ErrorSource& source, const MeasurementBatch& batch) {
  Cause cause{cause_name(source.name()), source.joint(), "", "", {}};
  if (const std::size_t at = source.name().find('@');
      at != std::string::npos &&
      (cause.cause.ends_with("_changed") || cause.cause == "tracker_moved" || cause.cause == "joint_slip")) {
    const int index = std::stoi(source.name().substr(at + 1)) - 1;
    for (const Measurement& m : batch.measurements) {
      if (m.context.index == index) cause.pose_id = m.pose_id;
    }
  }
  return cause;
}

}  // namespace trammel::cause_search
