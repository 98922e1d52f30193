#include "server/diagnose/triage/batch_alternatives.h"

#include <algorithm>
#include <set>

namespace trammel::batch_triage {

namespace {

const std::set<std::string> kNotTheArm = {"base",          "tool",       "payload",      "tracker_moved",
                                          "tracker_drift", "joint_slip", "tool_changed", "payload_changed",
                                          "time_lag"};

std::string cause_of(const ErrorSource& source) {
  const std::string name = source.name();
  return name.substr(0, name.find_first_of(":@"));
}

Alternative started(const Cause& cause, const PhysicalModel& model) {
  Alternative one;
  one.cause = cause;
  one.model = model;
  one.known = model.values;
  one.free.assign(static_cast<std::size_t>(model.values.size()), false);
  one.base = one.free;
  return one;
}

/// Frees the source that `spec` names in `set`, which it is added for where the model has none.
bool set_free(Alternative& one, const std::string& spec, std::vector<bool>& set) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : one.model.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (source->name() == spec) {
      std::fill_n(set.begin() + first, count, true);
      return true;
    }
    first += count;
  }
  auto added = make_error_source(spec, *one.model.cell);
  if (!added) return false;
  const auto count = static_cast<Eigen::Index>((*added)->parameters().size());
  const Eigen::Index at = add_source(one.model, std::move(*added));
  one.known = one.model.values;
  one.free.insert(one.free.begin() + at, static_cast<std::size_t>(count), false);
  one.base.insert(one.base.begin() + at, static_cast<std::size_t>(count), false);
  std::fill_n(set.begin() + at, count, true);
  return true;
}

}  // namespace

Alternative Alternatives::none() const { return started({}, physics_); }

std::vector<Alternative> Alternatives::from(int first, const std::string& pose_id) const {
  std::vector<Alternative> all;
  const auto add = [&](const Cause& cause, const std::string& spec, bool harmful) {
    Alternative one = started(cause, physics_);
    if (!set_free(one, spec, one.free)) return;
    one.cause.pose_id = pose_id;
    one.first = first;
    one.harmful = harmful || first > 0;
    if (cause.cause == "tracker_moved" && first == 0) one.model.X_WB = X_WB_;
    all.push_back(std::move(one));
  };
  add({"tracker_moved", -1, "", "", {}}, "base", false);
  add({"tool_changed", -1, "", "", {}}, "tool", true);
  if (carries()) add({"payload_changed", -1, "", "", {}}, "payload", true);
  for (int joint = 0; joint < physics_.cell->robot.size(); ++joint) {
    add({"joint_slip", joint, "", "", {}}, fmt::format("joint_slip:{}@1", joint + 1), false);
  }
  if (first == 0) add_drift(all);
  return all;
}

std::vector<Alternative> Alternatives::with_the_tracker() const {
  std::vector<Alternative> all = from(0, "");
  std::erase_if(all, [](const Alternative& one) { return one.cause.cause == "tracker_moved"; });
  for (Alternative& one : all) {
    one.tracker_elsewhere = set_free(one, "base", one.base);
    one.model.X_WB = X_WB_;
  }
  return all;
}

bool Alternatives::carries() const {
  return !physics_.cell->payloads.empty() &&
         std::any_of(physics_.sources.begin(), physics_.sources.end(), [](const ErrorSourcePtr& source) {
           const std::string cause = cause_of(*source);
           return cause.starts_with("compliance") || cause == "link_bending";
         });
}

void Alternatives::add_drift(std::vector<Alternative>& all) const {
  Alternative one = started({"drift", -1, "", "", {}}, physics_);
  Eigen::Index first = 0;
  bool any = false;
  for (const ErrorSourcePtr& source : physics_.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (!kNotTheArm.contains(cause_of(*source))) {
      std::fill_n(one.free.begin() + first, count, true);
      any = true;
    }
    first += count;
  }
  if (any) all.push_back(std::move(one));
}

}  // namespace trammel::batch_triage
