#include "server/tasks/train/lasting_sources.h"

#include <algorithm>

#include "server/error_sources/spelling.h"
#include "server/measurement/warmth.h"

namespace trammel {

std::vector<std::string> lasting_sources(const std::vector<std::string>& sources) {
  std::vector<std::string> lasting;
  std::copy_if(sources.begin(), sources.end(), std::back_inserter(lasting),
               [](const std::string& source) {
                 const CauseRecord* cause = find_cause(source);
                 return cause == nullptr || cause->lasting == causes::Lasting::kAlways;
               });
  return lasting;
}

std::vector<std::string> sources_in_force(const CompensatedModel& model, const Cell& cell,
                                          const CheckedBatch& batch) {
  const std::vector<std::string> listed = spelled_out(cell.model.error_sources, cell);
  std::vector<std::string> sources;
  for (const ErrorSourcePtr& source : model.parts().physics.sources) {
    sources.push_back(as_listed(source->name(), listed));
  }
  return model.provenance().batch_hash == batch.hash() ? sources : lasting_sources(sources);
}

std::optional<std::string> level_with_additions(const Cell& cell, const CompensatedModel& in_force,
                                                const MeasurementBatch& batch) {
  if (cell.model.beside_auto) return std::nullopt;  // the data decide each time
  std::vector<std::string> level = spelled_out(cell.model.error_sources, cell);
  const auto listed = [&](const std::string& name) {
    return std::find(level.begin(), level.end(), as_listed(name, level)) != level.end();
  };
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : in_force.parts().physics.sources)
    names.push_back(source->name());
  const std::size_t own = level.size();
  const bool is_warm = shows_warmth(batch);
  for (const std::string& name : lasting_sources(names)) {
    if (!listed(name) && (is_warm || !cause_spelled(name).needs.temperature)) level.push_back(name);
  }
  if (level.size() == own) return std::nullopt;
  return level_of(level);
}

}  // namespace trammel
