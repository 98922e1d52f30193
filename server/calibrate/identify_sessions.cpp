#include "server/calibrate/identify_sessions.h"

#include <algorithm>
#include <cmath>

#include "server/calibrate/one_session.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

constexpr std::size_t kMostChanges = 12;
// Nat, beside Schwarz's price of the added parameters: a change is chosen only if it makes the data
// so much more likely than a noisy session does.
constexpr double kInsteadOfNoise = 10;

/// The sources of the model as they are: each in the form and with the orders that were found.
std::vector<std::string> names_of(const PhysicalModel& model) {
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : model.sources) names.push_back(source->name());
  return names;
}

struct Proposal {
  Change change;
  bool instead_of_noise = false;
};

std::optional<Proposal> proposed_change(const CalibrationResult& found,
                                        const MeasurementBatch& batch) {
  if (std::optional<Change> seen = strongest_change(found, batch))
    return Proposal{std::move(*seen)};
  std::optional<Change> instead = change_instead_of_noise(found, batch);
  if (!instead) return std::nullopt;
  return Proposal{std::move(*instead), true};
}

bool is_better(const CalibrationResult& with, const CalibrationResult& without,
               const Proposal& proposal) {
  double price = 0;
  if (proposal.instead_of_noise) {
    double rows = 0;  // the number of rows that show it
    const std::size_t end =
        is_of_one_session(proposal.change) ? proposal.change.session + 1 : with.sessions.size();
    for (std::size_t s = proposal.change.session; s < end; ++s)
      rows += 3.0 * with.sessions[s].poses;
    const auto added = static_cast<double>(with.parameters.size()) -
                       static_cast<double>(without.parameters.size());
    price = kInsteadOfNoise + 0.5 * added * std::log(rows);
  }
  return with.log_likelihood > without.log_likelihood + price;
}

/// The sources of the model, and those that the change adds.
std::vector<std::string> with_change(const PhysicalModel& model, const Change& change) {
  std::vector<std::string> names = names_of(model);
  for (std::string& source : change.sources()) names.push_back(std::move(source));
  return names;
}

/// Drops changes, the weakest first, that the sessions no longer support beside the others.
Result<IdentifiedSessions> without_idle_changes(const Identify& identify, IdentifiedSessions found,
                                                const MeasurementBatch& batch) {
  for (std::size_t k = 0; k < found.changes.size() && found.changes.size() > 1;) {
    std::vector<std::string> fewer = names_of(found.calibration.model);
    for (const std::string& source : found.changes[k].sources()) std::erase(fewer, source);
    auto without = TRY(identify(fewer));
    const std::optional<Proposal> missed = proposed_change(without, batch);
    if (missed && is_better(found.calibration, without, *missed)) {
      ++k;
      continue;
    }
    found.calibration = std::move(without);
    found.changes.erase(found.changes.begin() + static_cast<std::ptrdiff_t>(k));
    k = 0;
  }
  return found;
}

}  // namespace

Result<IdentifiedSessions> identify_sessions(const Identify& identify,
                                             const std::vector<std::string>& sources,
                                             const MeasurementBatch& batch,
                                             const std::function<Status(double share)>& go_on) {
  auto calibration = TRY(identify(sources));
  IdentifiedSessions found{std::move(calibration), {}};
  if (!has_sessions(batch)) return found;
  while (found.changes.size() < kMostChanges) {
    TRY(go_on(static_cast<double>(found.changes.size()) / kMostChanges));
    std::optional<Proposal> proposal = proposed_change(found.calibration, batch);
    if (!proposal) break;
    auto with = identify(with_change(found.calibration.model, proposal->change));
    if (!with || !is_better(*with, found.calibration, *proposal)) break;
    found.calibration = std::move(*with);
    found.changes.push_back(std::move(proposal->change));
  }
  return without_idle_changes(identify, std::move(found), batch);
}

}  // namespace trammel
