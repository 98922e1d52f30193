#include "server/diagnose/triage/batch_alternatives.h"

#include <algorithm>

namespace trammel::batch_triage {

namespace {

using causes::Lasting;
using causes::Part;
using causes::Scope;

bool is_of_the_arm(const CauseRecord& record) {
  return record.lasting == Lasting::kAlways &&
         (record.scope == Scope::kArm || record.scope == Scope::kJoint);
}

/// The source that acts at all poses in place of a step of `joint`: the source of the whole cause,
/// or the step itself if it is only one number of that cause.
std::string as_a_whole(const CauseRecord& record, int joint) {
  const causes::Rival& whole = *whole_of(record);
  if (whole.parameter.empty()) return std::string(whole.cause);
  return to_string(cause_at(record, joint)) + "@1";
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

/// Frees the source that `spec` names in `set`, and adds it if the model lacks it.
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

bool moves_base(const CauseRecord& record) {
  const causes::Rival* whole = whole_of(record);
  return whole != nullptr && cause_spelled(whole->cause).part == Part::kBase;
}

Alternative Alternatives::none() const { return started({}, physics_); }

std::vector<Alternative> Alternatives::from(int first, const std::string& pose_id) const {
  std::vector<Alternative> all;
  const auto add = [&](const Cause& cause, const std::string& spec, bool harmful) {
    Alternative one = started(cause, physics_);
    if (!set_free(one, spec, one.free)) return;
    one.cause.pose_id = pose_id;
    one.first = first;
    one.harmful = harmful || first > 0;
    if (moves_base(record_of(cause)) && first == 0) one.model.X_WB = X_WB_;
    all.push_back(std::move(one));
  };
  for (const CauseRecord* record : all_causes()) {
    if (record->lasting != Lasting::kFromAPose || (record->needs.payload && !carries())) continue;
    const bool of_joint = record->scope == Scope::kJoint;
    for (int joint = of_joint ? 0 : -1; joint < (of_joint ? physics_.cell->robot.size() : 0);
         ++joint)
      add(cause_at(*record, joint), as_a_whole(*record, joint), record->whole_batch->harmful);
  }
  if (first == 0) add_drift(all);
  return all;
}

std::vector<Alternative> Alternatives::with_the_tracker() const {
  std::vector<Alternative> all = from(0, "");
  std::erase_if(all, [](const Alternative& one) { return moves_base(record_of(one.cause)); });
  for (Alternative& one : all) {
    one.tracker_elsewhere =
        set_free(one, std::string(cause_correcting(Part::kBase).spelling), one.base);
    one.model.X_WB = X_WB_;
  }
  return all;
}

bool Alternatives::carries() const {
  return !physics_.cell->payloads.empty() &&
         std::any_of(physics_.sources.begin(), physics_.sources.end(),
                     [](const ErrorSourcePtr& source) { return source->cause().gives_way; });
}

void Alternatives::add_drift(std::vector<Alternative>& all) const {
  Alternative one =
      started(cause_at(cause_that_stands_for(causes::StandsFor::kArmNotAsModelled)), physics_);
  Eigen::Index first = 0;
  bool any = false;
  for (const ErrorSourcePtr& source : physics_.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (is_of_the_arm(source->cause())) {
      std::fill_n(one.free.begin() + first, count, true);
      any = true;
    }
    first += count;
  }
  if (any) all.push_back(std::move(one));
}

}  // namespace trammel::batch_triage
