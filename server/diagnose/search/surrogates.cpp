#include "server/diagnose/search/surrogates.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

constexpr double kBetweenPoses = 30;  // s, the usual time between poses of a tracker and a robot
constexpr double kWarming = 5;        // K over the batch
constexpr double kUnrecorded = 1e9;
constexpr double kWarmingScale = 0.5;  // of the batch: the time constant of its approach

bool none(const MeasurementBatch& batch, bool (*has)(const PoseContext&)) {
  return std::none_of(batch.measurements.begin(), batch.measurements.end(),
                      [&](const Measurement& m) { return has(m.context); });
}

}  // namespace

Surrogates put_in_surrogates(MeasurementBatch& batch, const Chain& robot) {
  if (!none(batch, [](const PoseContext& c) { return c.velocity.has_value(); })) return {};
  const Surrogates put = {
      none(batch, [](const PoseContext& c) { return c.time.has_value(); }),
      none(batch, [](const PoseContext& c) { return c.temperature.has_value(); }),
      none(batch, [](const PoseContext& c) { return !c.direction.empty(); })};
  const auto count = static_cast<double>(batch.measurements.size());
  const Measurement* last = nullptr;
  double row = 0;
  for (Measurement& m : batch.measurements) {
    if (put.time) m.context.time = kBetweenPoses * row;
    if (put.temperature)
      m.context.temperature = 20 + kWarming * (1 - std::exp(-row / (kWarmingScale * count)));
    if (put.direction) {
      const JointVector way =
          robot.gear_angles(last == nullptr ? JointVector::Zero(m.context.q.size())
                                            : JointVector(m.context.q - last->context.q));
      const bool stays = last != nullptr && way.isZero(0);  // another reflector, or the same again
      m.context.direction = stays ? last->context.direction : std::vector<int>();
      for (Eigen::Index j = 0; !stays && j < way.size(); ++j)
        m.context.direction.push_back(way(j) > 0 ? 1 : way(j) < 0 ? -1 : 0);
    }
    last = &m;
    ++row;
  }
  return put;
}

void take_over_surrogates(const Surrogates& surrogates, const MeasurementBatch& whole,
                          MeasurementBatch& part) {
  std::map<int, const PoseContext*> by_index;
  for (const Measurement& m : whole.measurements) by_index[m.context.index] = &m.context;
  for (Measurement& m : part.measurements) {
    const PoseContext& from = *by_index.at(m.context.index);
    if (surrogates.time) m.context.time = from.time;
    if (surrogates.temperature) m.context.temperature = from.temperature;
    if (surrogates.direction) m.context.direction = from.direction;
  }
}

void take_out_surrogates(const Surrogates& surrogates, MeasurementBatch& batch) {
  for (Measurement& m : batch.measurements) {
    if (surrogates.time) m.context.time.reset();
    if (surrogates.temperature) m.context.temperature.reset();
    if (surrogates.direction) m.context.direction.clear();
  }
}

bool is_by_surrogate(const Surrogates& surrogates, const Cause& cause) {
  const ContextNeeds& needs = record_of(cause).needs;
  return (surrogates.time && needs.time) || (surrogates.temperature && needs.temperature) ||
         (surrogates.direction && needs.direction);
}

bool has_made_up_numbers(const Surrogates& surrogates, const Cause& cause) {
  return is_by_surrogate(surrogates, cause) && !record_of(cause).needs.direction;
}

namespace {

/// True if every pose was approached from one and the same side of `joint`.
bool has_one_side(const MeasurementBatch& recorded, int joint) {
  const auto& rows = recorded.measurements;
  const auto side = [joint](const Measurement& m) {
    return m.context.direction[static_cast<std::size_t>(joint)];
  };
  return std::none_of(rows.begin(), rows.end(),
                      [](const Measurement& m) { return m.context.direction.empty(); }) &&
         side(rows.front()) != 0 &&
         std::all_of(rows.begin(), rows.end(),
                     [&](const Measurement& m) { return side(m) == side(rows.front()); });
}

bool has_one_temperature(const MeasurementBatch& recorded) {
  const auto& rows = recorded.measurements;
  const auto [low, high] =
      std::minmax_element(rows.begin(), rows.end(), [](const Measurement& a, const Measurement& b) {
        return a.context.temperature.value_or(-kUnrecorded) <
               b.context.temperature.value_or(-kUnrecorded);
      });
  return low->context.temperature &&
         *high->context.temperature - *low->context.temperature < thresholds::kSameTemperature;
}

/// True if the quantity on which a cause of `joint` depends was recorded and never changed.
bool is_constant(const ContextNeeds& needs, const MeasurementBatch& recorded, int joint) {
  return (needs.direction && joint >= 0 && has_one_side(recorded, joint)) ||
         (needs.temperature && has_one_temperature(recorded));
}

/// True if `model` identifies the parameter, or the whole cause, that absorbs the effect.
bool is_free(const PhysicalModel& model, const Cause& cause) {
  const std::vector<Parameter> own = model.parameters();
  if (!cause.parameter.empty())
    return std::any_of(own.begin(), own.end(),
                       [&](const Parameter& p) { return p.name == cause.parameter; });
  return std::any_of(model.sources.begin(), model.sources.end(), [&](const ErrorSourcePtr& source) {
    return &source->cause() == &record_of(cause);
  });
}

}  // namespace

std::vector<Inseparable> hidden_by_constancy(const PhysicalModel& model,
                                             const MeasurementBatch& recorded) {
  std::vector<Inseparable> pairs;
  for (const CauseRecord* record : all_causes()) {
    const bool of_joint = record->scope == causes::Scope::kJoint;
    for (const causes::Rival& rival : record->rivals) {
      if (rival.likeness != causes::Likeness::kWhereConstant) continue;
      for (int joint = of_joint ? 0 : -1; joint < (of_joint ? model.cell->robot.size() : 0);
           ++joint) {
        Cause taken_for = cause_at(cause_spelled(rival.cause));
        taken_for.parameter = parameter_of(rival, joint);
        if (is_constant(record->needs, recorded, joint) && is_free(model, taken_for))
          pairs.push_back({{cause_at(*record, joint), taken_for}, 1});
      }
    }
  }
  return pairs;
}

}  // namespace trammel::cause_search
