#include "server/calibrate/identify/check_needs.h"

#include <algorithm>

namespace trammel {

Status check_needs(const CalibrationProblem& problem) {
  const auto any = [&](auto has) {
    return std::any_of(problem.batch.measurements.begin(), problem.batch.measurements.end(),
                       [&](const Measurement& m) { return has(m.context); });
  };
  for (const ErrorSourcePtr& source : problem.model.sources) {
    const ContextNeeds needs = source->needs();
    const auto lacks = [&](const char* what, const std::string& column) {
      return refused("error source {} needs {}{}, which no pose has", source->name(), what,
                     column.empty() ? "" : " (" + column + ")")
          .of(column)
          .in("batch " + problem.batch.id);
    };
    if (needs.time && !any([](const PoseContext& c) { return c.time.has_value(); })) return lacks("a time", "time_s");
    if (needs.temperature && !any([](const PoseContext& c) { return c.temperature.has_value(); })) {
      return lacks("a temperature", "temperature_c");
    }
    const auto directed = [&](const PoseContext& c) {
      return !c.direction.empty() && c.direction[static_cast<std::size_t>(source->joint())] != 0;
    };
    if (needs.direction && !any(directed))
      return lacks("an approach direction", fmt::format("dir{}", source->joint() + 1));
    if (needs.velocity && !any([](const PoseContext& c) { return c.velocity.has_value(); })) {
      return lacks("a continuous path with times", "time_s");
    }
    const auto loaded = [&](const PoseContext& c) {
      const auto payload = problem.model.cell->payloads.find(c.payload);
      return payload != problem.model.cell->payloads.end() && payload->second.mass > 0;
    };
    if (needs.payload && !any(loaded)) return lacks("a payload with a mass", "");
  }
  return {};
}

}  // namespace trammel
