#include "server/measurement/sessions.h"

#include <algorithm>
#include <map>
#include <string>

namespace trammel {

namespace {

constexpr double kOldestUnixTime =
    1e9;  // s: September 2001; smaller times count from another start

/// A session in the order of the file.
struct Found {
  std::string id;
  std::optional<double> began;  // Unix time, s
};

/// The sessions in the order of their first rows.
std::vector<Found> sessions_in(const MeasurementBatch& batch) {
  std::vector<Found> found;
  std::map<std::string, std::size_t> place;
  for (const Measurement& m : batch.measurements) {
    const auto [at, is_new] = place.emplace(m.session_id, found.size());
    if (is_new) found.push_back({m.session_id, {}});
    Found& session = found[at->second];
    const double time = m.context.time.value_or(0);
    if (time >= kOldestUnixTime) session.began = std::min(session.began.value_or(time), time);
  }
  return found;
}

}  // namespace

bool has_sessions(const MeasurementBatch& batch) { return batch.sessions.size() > 1; }

void divide_into_sessions(MeasurementBatch& batch) {
  std::vector<Found> found = sessions_in(batch);
  if (found.size() < 2) return;
  if (std::all_of(found.begin(), found.end(),
                  [](const Found& one) { return one.began.has_value(); })) {
    std::stable_sort(found.begin(), found.end(),
                     [](const Found& a, const Found& b) { return *a.began < *b.began; });
  } else {
    batch.clock.reset();
  }
  std::map<std::string, int> place;
  batch.sessions.clear();
  for (const Found& session : found) {
    place[session.id] = static_cast<int>(batch.sessions.size());
    batch.sessions.push_back(session.id.empty() ? batch.id : session.id);
  }
  for (Measurement& m : batch.measurements) m.session = place.at(m.session_id);
  std::stable_sort(
      batch.measurements.begin(), batch.measurements.end(),
      [](const Measurement& a, const Measurement& b) { return a.session < b.session; });
  int index = 0;
  for (Measurement& m : batch.measurements) m.context.index = index++;
}

std::vector<MeasurementBatch> by_session(const MeasurementBatch& batch) {
  if (!has_sessions(batch)) return {batch};
  MeasurementBatch none = batch;
  none.measurements.clear();
  none.sessions.clear();
  none.source_text.clear();
  std::vector<MeasurementBatch> parts(batch.sessions.size(), none);
  for (std::size_t s = 0; s < parts.size(); ++s) parts[s].id = batch.sessions[s];
  for (const Measurement& m : batch.measurements)
    parts[static_cast<std::size_t>(m.session)].measurements.push_back(m);
  return parts;
}

MeasurementBatch only_sessions(const MeasurementBatch& batch, const std::vector<bool>& kept) {
  MeasurementBatch some = batch;
  std::erase_if(some.measurements,
                [&](const Measurement& m) { return !kept[static_cast<std::size_t>(m.session)]; });
  std::vector<int> place;
  some.sessions.clear();
  for (std::size_t s = 0; s < kept.size(); ++s) {
    place.push_back(static_cast<int>(some.sessions.size()));
    if (kept[s]) some.sessions.push_back(batch.sessions[s]);
  }
  for (Measurement& m : some.measurements) m.session = place[static_cast<std::size_t>(m.session)];
  if (some.sessions.size() == 1) some.sessions.clear();
  return some;
}

}  // namespace trammel
