#include "server/trainer/pipeline/lasting_sources.h"

#include <algorithm>
#include <array>

#include "server/error_sources/error_source.h"

namespace trammel {

namespace {

constexpr std::array<std::string_view, 5> kOfOneBatch = {"tracker_moved", "tracker_drift", "joint_slip", "tool_changed",
                                                         "payload_changed"};

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

}  // namespace

std::vector<std::string> lasting_sources(const std::vector<std::string>& sources) {
  std::vector<std::string> lasting;
  std::copy_if(sources.begin(), sources.end(), std::back_inserter(lasting), [](const std::string& source) {
    const std::string cause = source.substr(0, source.find_first_of(":@"));
    return std::find(kOfOneBatch.begin(), kOfOneBatch.end(), cause) == kOfOneBatch.end();
  });
  return lasting;
}

std::vector<std::string> sources_in_force(const CompensatedModel& model, const Cell& cell, const CheckedBatch& batch) {
  std::vector<std::string> sources;
  for (const ErrorSourcePtr& source : model.parts().physics.sources) {
    const bool chosen = source->name().starts_with("compliance") && contains(cell.model.error_sources, "compliance");
    sources.push_back(chosen ? "compliance" : source->name());
  }
  return model.provenance().batch_hash == batch.hash() ? sources : lasting_sources(sources);
}

std::optional<std::string> level_with_additions(const Cell& cell, const CompensatedModel& in_force) {
  std::vector<std::string> level = cell.model.error_sources;
  const auto listed = [&](const std::string& name) {
    return std::any_of(level.begin(), level.end(), [&](const std::string& spec) {
      return name == spec || (spec == "compliance" && name.starts_with("compliance"));
    });
  };
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : in_force.parts().physics.sources) names.push_back(source->name());
  const std::size_t own = level.size();
  for (const std::string& name : lasting_sources(names)) {
    if (!listed(name)) level.push_back(name);
  }
  if (level.size() == own) return std::nullopt;
  return level_of(level);
}

}  // namespace trammel
