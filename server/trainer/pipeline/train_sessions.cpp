#include "server/trainer/pipeline/train_sessions.h"

#include <algorithm>

#include "server/measurement/sessions.h"
#include "server/trainer/pipeline/given_up.h"

namespace trammel {

namespace {

constexpr std::size_t kMostChanges = 12;

/// The sources of the model as they are: each in the form and with the orders that were found.
std::vector<std::string> names_of(const PhysicalModel& model) {
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : model.sources) names.push_back(source->name());
  return names;
}

/// Drops changes, the weakest first, that the sessions do not speak for once the others are known.
Result<IdentifiedSessions> without_idle_changes(const Identify& identify, IdentifiedSessions found,
                                                const MeasurementBatch& batch) {
  for (std::size_t k = 0; k < found.changes.size() && found.changes.size() > 1;) {
    std::vector<std::string> fewer = names_of(found.calibration.model);
    for (const std::string& source : found.changes[k].sources()) std::erase(fewer, source);
    auto without = identify(fewer);
    if (!without) return tl::make_unexpected(without.error());
    const std::optional<Change> missed = strongest_change(*without, batch);
    if (missed) {
      ++k;
      continue;
    }
    found.calibration = std::move(*without);
    found.changes.erase(found.changes.begin() + static_cast<std::ptrdiff_t>(k));
    k = 0;
  }
  return found;
}

}  // namespace

std::vector<LeftOutSession> leave_out_unplaced(BatchSplit& split) {
  std::vector<LeftOutSession> left_out;
  if (!has_sessions(split.train)) return left_out;
  std::vector<bool> kept;
  for (const MeasurementBatch& session : by_session(split.train)) {
    const std::string why = why_not_placed(session);
    kept.push_back(why.empty());
    if (!why.empty()) left_out.push_back({session.id, why});
  }
  if (left_out.empty() || left_out.size() == kept.size()) return left_out;
  split = {only_sessions(split.train, kept), only_sessions(split.validation, kept)};
  return left_out;
}

Result<IdentifiedSessions> identify_sessions(const Identify& identify, const std::vector<std::string>& sources,
                                             const MeasurementBatch& batch,
                                             const std::function<bool(double share)>& go_on) {
  auto calibration = identify(sources);
  if (!calibration) return tl::make_unexpected(calibration.error());
  IdentifiedSessions found{std::move(*calibration), {}};
  if (!has_sessions(batch)) return found;
  while (found.changes.size() < kMostChanges) {
    if (!go_on(static_cast<double>(found.changes.size()) / kMostChanges)) return given_up();
    std::optional<Change> change = strongest_change(found.calibration, batch);
    if (!change) break;
    std::vector<std::string> more = names_of(found.calibration.model);
    for (std::string& source : change->sources()) more.push_back(std::move(source));
    auto with = identify(more);
    if (!with || with->log_likelihood <= found.calibration.log_likelihood) break;
    found.calibration = std::move(*with);
    found.changes.push_back(std::move(*change));
  }
  return without_idle_changes(identify, std::move(found), batch);
}

}  // namespace trammel
