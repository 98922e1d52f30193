#include "server/diagnose/search/surrogates.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

constexpr double kBetweenPoses = 30;  // s, as a tracker and a robot take that measure one after the other
constexpr double kWarming = 5;        // K over the batch
constexpr double kUnrecorded = 1e9;
constexpr double kWarmingScale = 0.5;  // of the batch: the time constant of its approach

bool none(const MeasurementBatch& batch, bool (*has)(const PoseContext&)) {
  return std::none_of(batch.measurements.begin(), batch.measurements.end(),
                      [&](const Measurement& m) { return has(m.context); });
}

}  // namespace

Surrogates put_in_surrogates(MeasurementBatch& batch) {
  if (!none(batch, [](const PoseContext& c) { return c.velocity.has_value(); })) return {};
  const Surrogates put = {none(batch, [](const PoseContext& c) { return c.time.has_value(); }),
                          none(batch, [](const PoseContext& c) { return c.temperature.has_value(); }),
                          none(batch, [](const PoseContext& c) { return !c.direction.empty(); })};
  const auto count = static_cast<double>(batch.measurements.size());
  const Measurement* last = nullptr;
  double row = 0;
  for (Measurement& m : batch.measurements) {
    if (put.time) m.context.time = kBetweenPoses * row;
    if (put.temperature) m.context.temperature = 20 + kWarming * (1 - std::exp(-row / (kWarmingScale * count)));
    if (put.direction) {
      m.context.direction.assign(static_cast<std::size_t>(m.context.q.size()), 0);
      for (Eigen::Index j = 0; last != nullptr && j < m.context.q.size(); ++j) {
        const double way = m.context.q(j) - last->context.q(j);
        m.context.direction[static_cast<std::size_t>(j)] = way > 0 ? 1 : way < 0 ? -1 : 0;
      }
    }
    last = &m;
    ++row;
  }
  return put;
}

void take_over_surrogates(const Surrogates& surrogates, const MeasurementBatch& whole, MeasurementBatch& part) {
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
  return (surrogates.time && cause.cause == "tracker_drift") ||
         (surrogates.temperature && cause.cause == "thermal_growth") ||
         (surrogates.direction && cause.cause == "backlash");
}

bool has_made_up_numbers(const Surrogates& surrogates, const Cause& cause) {
  return is_by_surrogate(surrogates, cause) && cause.cause != "backlash";
}

std::vector<Inseparable> hidden_by_constancy(const PhysicalModel& model, const MeasurementBatch& recorded) {
  const std::vector<Parameter> own = model.parameters();
  const auto is_free = [&](const std::string& name) {
    return std::any_of(own.begin(), own.end(), [&](const Parameter& p) { return p.name == name; });
  };
  std::vector<Inseparable> pairs;
  const auto& rows = recorded.measurements;
  const bool directions =
      std::all_of(rows.begin(), rows.end(), [](const Measurement& m) { return !m.context.direction.empty(); });
  for (int j = 0; directions && j < model.cell->robot.size(); ++j) {
    const auto side = [j](const Measurement& m) { return m.context.direction[static_cast<std::size_t>(j)]; };
    const bool one = side(rows.front()) != 0 && std::all_of(rows.begin(), rows.end(), [&](const Measurement& m) {
                       return side(m) == side(rows.front());
                     });
    const std::string zero = fmt::format("q{}", j + 1);
    if (one && is_free(zero)) pairs.push_back({{{"backlash", j, "", "", {}}, {"geometry", -1, zero, "", {}}}, 1});
  }
  const auto [low, high] =
      std::minmax_element(rows.begin(), rows.end(), [](const Measurement& a, const Measurement& b) {
        return a.context.temperature.value_or(-kUnrecorded) < b.context.temperature.value_or(-kUnrecorded);
      });
  const bool constant =
      low->context.temperature && *high->context.temperature - *low->context.temperature < thresholds::kSameTemperature;
  const bool lengths = std::any_of(model.sources.begin(), model.sources.end(),
                                   [](const ErrorSourcePtr& source) { return source->name() == "geometry"; });
  if (constant && lengths) pairs.push_back({{{"thermal_growth", -1, "", "", {}}, {"geometry", -1, "", "", {}}}, 1});
  return pairs;
}

}  // namespace trammel::cause_search
