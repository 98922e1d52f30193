#include "server/calibrate/identify/check_needs.h"

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "server/error_sources/spelling.h"

namespace trammel {

namespace {

bool has_mass(const PoseContext& context, const Cell& cell) {
  const auto payload = cell.payloads.find(context.payload);
  return payload != cell.payloads.end() && payload->second.mass > 0;
}

/// The need of a source, whether some pose meets it, and the column that records it.
struct Need {
  bool needed;
  std::function<bool(const PoseContext&)> has;
  const char* what;
  std::string column;
};

std::vector<Need> needs_of(const ErrorSource& source, const Cell& cell) {
  const ContextNeeds needs = source.needs();
  const int joint = source.joint();
  const auto directed = [joint](const PoseContext& c) {
    return !c.direction.empty() && c.direction[static_cast<std::size_t>(joint)] != 0;
  };
  return {{needs.time, [](const PoseContext& c) { return c.time.has_value(); }, "a time", "time_s"},
          {needs.temperature, [](const PoseContext& c) { return c.temperature.has_value(); },
           "a temperature", "temperature_c"},
          {needs.direction, directed, "an approach direction", fmt::format("dir{}", joint + 1)},
          {needs.velocity, [](const PoseContext& c) { return c.velocity.has_value(); },
           "a continuous path with times", "time_s"},
          {needs.before, [](const PoseContext& c) { return c.before.has_value(); },
           "the order of the poses in time", "time_s"},
          {needs.history, [](const PoseContext& c) { return !c.lagged.empty(); },
           "temperature and time of every pose", "temperature_c"},
          {needs.payload, [&cell](const PoseContext& c) { return has_mass(c, cell); },
           "a payload with a mass", ""}};
}

}  // namespace

Status check_needs(const CalibrationProblem& problem) {
  const std::vector<Measurement>& poses = problem.batch.measurements;
  for (const ErrorSourcePtr& source : problem.model.sources) {
    for (const Need& need : needs_of(*source, *problem.model.cell)) {
      const auto has = [&](const Measurement& m) { return need.has(m.context); };
      if (!need.needed || std::any_of(poses.begin(), poses.end(), has)) continue;
      return refused("{} needs {}{}, which no pose has", in_words(source->name()), need.what,
                     need.column.empty() ? "" : " (" + need.column + ")")
          .of(need.column)
          .with_text(source->name())
          .in("batch " + problem.batch.id);
    }
  }
  return {};
}

}  // namespace trammel
