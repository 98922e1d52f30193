#include "server/http/readiness.h"

#include <algorithm>
#include <map>

namespace trammel {
namespace {

using State = CellReadiness::State;
using Where = ModelRegistry::Place::Where;

constexpr int kMostCellsAsked =
    20;  // dark cells whose last training the store looks up, per answer

/// The values in which all cells are looked up, read once.
struct Known {
  std::map<std::string, ModelRegistry::Place> places;
  std::map<std::string, CellTrouble> troubles;
  std::map<std::string, JobProgress> unfinished;  // the first of each cell
};

Known known_of(const Watched& server) {
  Known known{server.registry.places(), server.trainer.cell_troubles(), {}};
  for (JobProgress& job : server.trainer.unfinished_jobs()) {
    std::string cell = job.cell;
    known.unfinished.emplace(std::move(cell), std::move(job));
  }
  return known;
}

State state_of(const CellTrouble& trouble) {
  switch (trouble.kind) {
    case CellTrouble::Kind::kOfAnotherRobot:
      return State::kOfAnotherRobot;
    case CellTrouble::Kind::kUnreadable:
      return State::kUnreadable;
    case CellTrouble::Kind::kOlderServed:
      return State::kOlderServed;
    case CellTrouble::Kind::kSetApart:
      return State::kDescribedOtherwise;
    case CellTrouble::Kind::kFormerFiles:
      return State::kFormerServed;
    case CellTrouble::Kind::kCopyServed:
      return State::kCopyServed;
  }
  return State::kUnreadable;
}

State state_at(Where where) {
  if (where == Where::kInMemory) return State::kServed;
  return where == Where::kComes ? State::kLoading : State::kOnDisk;
}

/// The readiness of a cell that never had a model in force, by its last training.
CellReadiness untrained(const std::string& cell, const Watched& server, int* asked) {
  CellReadiness one{cell, State::kUntrained, 0, "there is no model: submit a batch"};
  if (++*asked > kMostCellsAsked) return one;
  const auto jobs = server.store.recent_jobs(cell, 1);
  if (!jobs) return {cell, State::kUnreadable, 0, sentence(jobs.error())};
  const auto last = std::find_if(jobs->rbegin(), jobs->rend(), [](const StoredJob& job) {
    return job.kind() == JobKind::kTrain;
  });
  if (last == jobs->rend()) return one;
  one.state = State::kTrainingEnded;
  one.why = fmt::format("job {} ended without a model in force: {}", last->id, last->message);
  return one;
}

CellReadiness readiness_of(const std::string& cell, const Known& known, const Watched& server,
                           int* asked) {
  const auto place = known.places.find(cell);
  const auto trouble = known.troubles.find(cell);
  if (place != known.places.end()) {
    CellReadiness one{cell, state_at(place->second.where), place->second.version};
    if (one.state == State::kLoading) one.why = "its model is being loaded";
    if (trouble != known.troubles.end()) {
      one.state = state_of(trouble->second);
      one.why = trouble->second.what;
    }
    return one;
  }
  const bool has_other_files =
      trouble != known.troubles.end() && state_of(trouble->second) == State::kFormerServed;
  if (has_other_files)
    return {cell, State::kDescribedOtherwise, 0,
            trouble->second.what};  // and no model to continue with
  if (trouble != known.troubles.end())
    return {cell, state_of(trouble->second), 0, trouble->second.what};
  if (const auto job = known.unfinished.find(cell); job != known.unfinished.end())
    return {cell, State::kInTraining, 0,
            fmt::format("job {} is making its first model", job->second.job)};
  return untrained(cell, server, asked);
}

/// Notes on troubles that do not stop it from answering.
std::vector<std::string> notes_of(const Watched& server) {
  std::vector<std::string> notes;
  const StoreState state = server.store.state();
  if (state.why_not_written)
    notes.push_back(
        fmt::format("the store cannot be {}: {}",
                    state.readable ? "written" : "read, copies of its models are served",
                    sentence(*state.why_not_written)));
  if (!state.clock.empty()) notes.push_back(state.clock);
  notes.insert(notes.end(), state.damages.begin(), state.damages.end());
  for (const ServerInRecord& one : server.trainer.servers_seen()) {
    if (one.is_gone)
      notes.push_back(fmt::format("server {} on {} is gone: not heard of for {} s", one.self.server,
                                  one.self.host, one.silent_s));
  }
  return notes;
}

/// The record and its servers, without asking it.
nlohmann::ordered_json record_seen(const Watched& server) {
  const StoreState state = server.store.state();
  nlohmann::ordered_json servers = nlohmann::ordered_json::array();
  for (const ServerInRecord& one : server.trainer.servers_seen())
    servers.push_back({{"server", one.self.server},
                       {"host", one.self.host},
                       {"gone", one.is_gone},
                       {"serves", one.self.serves},
                       {"trains", one.self.trains},
                       {"changes_behind", one.behind}});
  nlohmann::ordered_json record = {{"reachable", !state.why_not_written},
                                   {"away_since_unix_s", nullptr},
                                   {"servers", std::move(servers)}};
  if (state.why_not_written) record["away_since_unix_s"] = state.since;
  return record;
}

nlohmann::ordered_json json_of(const CellReadiness& one) {
  nlohmann::ordered_json json = {
      {"cell", one.cell}, {"state", to_text(one.state)}, {"version", one.version}};
  if (!one.why.empty()) json["why"] = one.why;
  return json;
}

Readiness not_ready(const char* state, const std::string& why) {
  return {false, {{"ready", false}, {"state", state}, {"why", why}}};
}

Readiness of_cells(const std::vector<CellReadiness>& cells) {
  nlohmann::ordered_json dark = nlohmann::ordered_json::array(),
                         noted = nlohmann::ordered_json::array();
  for (const CellReadiness& one : cells) {
    if (one.is_dark()) dark.push_back(json_of(one));
    if (!one.is_dark() && !one.why.empty()) noted.push_back(json_of(one));
  }
  const bool ready = dark.empty();
  return {ready,
          {{"ready", ready},
           {"state", ready ? "serving" : "dark"},
           {"cells", cells.size()},
           {"dark", std::move(dark)},
           {"noted", std::move(noted)}}};
}

}  // namespace

const char* to_text(CellReadiness::State state) {
  switch (state) {
    case State::kServed:
      return "served";
    case State::kOnDisk:
      return "on_disk";
    case State::kCopyServed:
      return "copy_served";
    case State::kFormerServed:
      return "former_files";
    case State::kOlderServed:
      return "older_served";
    case State::kLoading:
      return "loading";
    case State::kUntrained:
      return "untrained";
    case State::kInTraining:
      return "in_training";
    case State::kTrainingEnded:
      return "training_ended";
    case State::kOfAnotherRobot:
      return "of_another_robot";
    case State::kUnreadable:
      return "unreadable";
    case State::kDescribedOtherwise:
      return "described_otherwise";
  }
  return "";
}

std::vector<CellReadiness> cells_readiness(const Watched& server) {
  const Known known = known_of(server);
  std::vector<CellReadiness> all;
  int asked = 0;
  for (const auto& [name, cell] : server.trainer.cells())
    all.push_back(readiness_of(name, known, server, &asked));
  return all;
}

Readiness readiness(const Watched& server, ServerPhase phase, const std::string& cell) {
  if (phase == ServerPhase::kStarting) return not_ready("starting", "it is not up yet");
  if (phase == ServerPhase::kStopping) return not_ready("stopping", "it stops");
  const Movement movement = server.movement();
  if (!movement.still.empty())
    return not_ready("hung", fmt::format("no progress in: {}", fmt::join(movement.still, ", ")));
  std::vector<CellReadiness> cells = cells_readiness(server);
  if (!cell.empty())
    std::erase_if(cells, [&](const CellReadiness& one) { return one.cell != cell; });
  if (cells.empty()) return not_ready("unknown", fmt::format("cell {} is not served here", cell));
  Readiness told = of_cells(cells);
  told.told["notes"] = notes_of(server);
  told.told["record"] = record_seen(server);
  return told;
}

}  // namespace trammel
