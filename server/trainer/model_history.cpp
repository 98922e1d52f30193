#include "server/trainer/model_history.h"

#include <algorithm>
#include <utility>

#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/tasks/accept/fits_cell.h"

namespace trammel {

namespace {

constexpr int kMostAttempts = 8;  // attempts, since others may change the version in force
                                  // meanwhile
constexpr std::size_t kMostServedBefore =
    4;  // versions that a new one is held against besides the one in force
constexpr std::size_t kMostReadBefore = 8;  // earlier versions that are read, since some may not
                                            // load

JobOutcome outcome_of(const GateVerdict& verdict) {
  JobOutcome outcome;
  outcome.verdict = verdict.put_in_force ? JobVerdict::kInForce
                    : verdict.undecided  ? JobVerdict::kUndecided
                                         : JobVerdict::kNotBetter;
  outcome.held_back = verdict.held_back;
  outcome.before = verdict.figures.before;
  outcome.after = verdict.figures.after;
  outcome.limit = verdict.figures.limit;
  outcome.why = verdict.why;
  if (!verdict.put_in_force) outcome.next = "activate it if it is wanted";
  return outcome;
}

}  // namespace

ModelHistory::ModelHistory(const CellBook& cells, Store& store, ModelRegistry& registry)
    : cells_(cells), store_(store), registry_(registry) {
  registry_.set_source({[this](const std::string& cell) { return load_in_force(cell); },
                        [this](const std::string& cell, int version) {
                          return load_for_service(cell, version).map([&](CompensatedModel model) {
                            return ServedModel{cell, version, std::move(model)};
                          });
                        },
                        [this](const ServedModelPtr& model) {
                          if (listener_) listener_(*model, true);
                        }});
}

Mutex& ModelHistory::changes_of(const std::string& cell) {
  const MutexLock lock(changing_mutex_);
  return changing_[cell];
}

std::vector<std::string> ModelHistory::announce_all() {
  std::map<std::string, int> in_force;
  if (store_.is_shared())
    in_force = store_.versions_in_force().value_or(std::map<std::string, int>());
  std::vector<std::string> notices;
  for (const auto& [name, cell] : cells_.now()) {
    if (const auto known = in_force.find(name); known != in_force.end()) {
      registry_.announce(name, known->second);
    } else if (auto announced = announce_from_store(name); !announced) {
      notices.push_back(sentence(announced.error()));
    }
  }
  return notices;
}

ModelHistory::~ModelHistory() { registry_.set_source({}); }

Status ModelHistory::announce_from_store(const std::string& cell) {
  const Status taken_back = store_.take_back_from_copy(cell);
  const std::vector<int> versions = store_.versions_to_serve(cell);
  if (!versions.empty()) registry_.announce(cell, versions.front());
  return taken_back;
}

Result<ServedModel> ModelHistory::load_in_force(const std::string& cell) {
  std::optional<Error> why_not;
  for (const int version : store_.versions_to_serve(cell)) {
    auto read = store_.read(cell, version);
    if (!read) {
      if (!why_not) why_not = read.error();
      continue;
    }
    const auto fits = check_fits_cell(read->model, *cells_.now().at(cell),
                                      fmt::format("version {} of cell {}", version, cell));
    if (!fits) {
      set_trouble(cell, CellTrouble{CellTrouble::Kind::kOfAnotherRobot, sentence(fits.error())});
      return tl::make_unexpected(fits.error());
    }
    // A version that lost its copy gets a new one. If the store cannot provide its text, it was
    // loaded from its copy.
    static_cast<void>(store_.copy_model_in_force(cell));
    std::optional<CellTrouble> trouble;
    if (!read->damage.empty()) trouble = {CellTrouble::Kind::kCopyServed, read->damage};
    if (why_not)
      trouble = {CellTrouble::Kind::kOlderServed,
                 fmt::format("cell {}: version {} is served instead of a newer one: {}", cell,
                             version, sentence(*why_not))};
    set_trouble(cell, trouble);
    return ServedModel{cell, version, std::move(read->model)};
  }
  if (!why_not) return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell);
  set_trouble(cell,
              CellTrouble{CellTrouble::Kind::kUnreadable,
                          fmt::format("cell {} is not served: {}", cell, sentence(*why_not))});
  return tl::make_unexpected(*why_not);
}

std::vector<std::string> ModelHistory::troubles() const {
  const MutexLock lock(troubles_mutex_);
  std::vector<std::string> all;
  for (const auto& [cell, trouble] : troubles_) all.push_back(trouble.what);
  return all;
}

std::map<std::string, CellTrouble> ModelHistory::cell_troubles() const {
  const MutexLock lock(troubles_mutex_);
  return troubles_;
}

void ModelHistory::set_trouble(const std::string& cell, const std::optional<CellTrouble>& trouble) {
  const MutexLock lock(troubles_mutex_);
  if (trouble) {
    troubles_[cell] = *trouble;
  } else {
    troubles_.erase(cell);
  }
}

Result<CompensatedModel> ModelHistory::load_for_service(const std::string& cell,
                                                        int version) const {
  auto model = store_.model(cell, version);
  if (!model) return model;
  TRY(check_fits_cell(*model, *cells_.now().at(cell),
                      fmt::format("version {} of cell {}", version, cell)));
  return model;
}

Status ModelHistory::activate(const std::string& cell, int version, const ChangeId& id,
                              const std::optional<GateVerdict>& judged) {
  TRY(cells_.find(cell));
  const auto made = TRY(store_.outcome_of(id));
  if (made) return {};
  auto model = TRY(registry_.version(cell, version));
  const MutexLock lock(changes_of(cell));
  const auto made_meanwhile = TRY(store_.outcome_of(id));
  if (made_meanwhile) return {};
  const std::optional<JobOutcome> figures =
      judged ? std::optional(outcome_of(*judged)) : std::nullopt;
  TRY(store_.activate(cell, version, id, figures));
  if (registry_.version_in_force(cell) != version) put_in_force(std::move(model));
  return {};
}

Status ModelHistory::follow(const std::string& cell) {
  const MutexLock lock(
      changes_of(cell));  // the lock delays this server's decisions until the comparison is done
  const auto decided = TRY(store_.version_in_force(cell));
  if (!decided || *decided == registry_.version_in_force(cell)) return {};
  auto model = registry_.version(cell, *decided);
  if (!model) {
    // A model made for the record's present files may not fit the earlier ones: this server keeps
    // its model.
    if (cells_.find_apart(cell) && model.error().code != ErrorCode::kBusy) return {};
    registry_.announce(cell, *decided);  // requests get the reason why it is not served
    if (model.error().code == ErrorCode::kBusy) return tl::make_unexpected(model.error());
    return {};
  }
  put_in_force(std::move(*model));
  static_cast<void>(store_.copy_model_in_force(cell));  // to start from while the record is away
  return {};
}

Result<ModelHistory::WayBack> ModelHistory::way_back(const std::string& cell) const {
  auto before = TRY(store_.previous_in_force(cell));
  const auto now = TRY(store_.version_in_force(cell));
  return WayBack{now.value_or(0), std::move(before)};
}

Result<std::pair<int, ServedModelPtr>> ModelHistory::load_first(
    const std::string& cell, const std::vector<int>& before) const {
  std::optional<Error> why_not;
  for (std::size_t i = 0; i < before.size(); ++i) {
    auto model = registry_.version(cell, before[i]);
    if (model) return std::pair(static_cast<int>(i) + 1, std::move(*model));
    if (model.error().code == ErrorCode::kBusy)
      return tl::make_unexpected(model.error());  // it exists, but cannot be loaded now
    if (!why_not) why_not = model.error();
  }
  return tl::make_unexpected(*why_not);
}

Result<int> ModelHistory::rollback(const std::string& cell, const ChangeId& id) {
  TRY(cells_.find(cell));
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    const auto made = TRY(store_.outcome_of(id));
    if (made) return made->version;
    // Loading takes a while, so it happens without the lock.
    const auto way = TRY(way_back(cell));
    auto found = TRY(load_first(cell, way.before));
    const MutexLock lock(changes_of(cell));
    if (const auto now = way_back(cell); !now || *now != way) continue;
    ChangeId decided = id;
    if (!decided.expected_version) decided.expected_version = way.version_now;
    const auto restored = store_.rollback(cell, found.first, decided);
    const bool changed_elsewhere =
        !restored && restored.error().code == ErrorCode::kConflict && !id.expected_version;
    if (changed_elsewhere) continue;
    if (!restored) return restored;
    // If others left this version and came back meanwhile, the target of the rollback is another
    // one.
    if (found.second->version == *restored) {
      put_in_force(std::move(found.second));
    } else if (auto other = registry_.version(cell, *restored)) {
      put_in_force(std::move(*other));
    }
    return restored;
  }
  return failure(ErrorCode::kBusy, "cell {}: what is in force changes all the time", cell)
      .next("try again later");
}

Result<CompensatedModel> ModelHistory::model_from(const std::string& cell, const std::string& text,
                                                  const char* what) const {
  const auto served = TRY(cells_.find(cell));
  auto model = deserialize(text, what);
  if (!model) return model;
  const std::string& id = model->provenance().id;
  if (model->cell().name != cell) {
    return refused("{} {} is of cell {}, not {}", what, id, model->cell().name, cell)
        .of("cell")
        .with_text(model->cell().name);
  }
  TRY(check_fits_cell(*model, *served, fmt::format("{} {}", what, id)));
  return model;
}

Result<int> ModelHistory::import_model(const std::string& cell, const std::string& text,
                                       const ChangeId& id) {
  const auto model = TRY(model_from(cell, text, "imported model"));
  const MutexLock lock(changes_of(cell));
  const auto present = TRY(store_.models(cell));
  for (const StoredModel& stored : present) {
    if (stored.hash == model.provenance().hash) return stored.version;
  }
  const auto version = store_.add_model(cell, model, 0, false, "", false, id);
  if (version && listener_) listener_({cell, *version, model}, false);
  return version;
}

GateVerdict ModelHistory::within_step_limit(GateVerdict verdict, const Candidate& candidate,
                                            const ServedModel* present) const {
  const std::optional<double>& limit = cells_.now().at(candidate.job.cell)->step_limit;
  if (!verdict.put_in_force || present == nullptr || !limit) return verdict;
  const auto step =
      farthest_step(present->model, candidate.model, recent_poses_.of(candidate.job.cell));
  if (!step || *step <= *limit) return verdict;
  verdict.put_in_force = false;
  verdict.undecided = true;
  verdict.held_back = HeldBack::kStepLimit;
  verdict.why +=
      fmt::format("; but a pose recently asked for would move by {:.4f} mm, limit {:g} mm",
                  to_mm(*step), to_mm(*limit));
  verdict.message = fmt::format(
      "not in force: {}; version {} stays in force; activate the new one if it is wanted",
      verdict.why, present->version);
  return verdict;
}

Result<ModelHistory::Judged> ModelHistory::judged(const Candidate& candidate,
                                                  const Judging& judging,
                                                  const ServedModel* present) const {
  const auto may_release = TRY(store_.may_release(candidate.job.id));
  const auto others = TRY(opponents(candidate.job.cell, present));
  const auto judged_by_poses = TRY(judging(others));
  const std::optional<GateVerdict> verdict = within_step_limit(judged_by_poses, candidate, present);
  const bool released = may_release && (verdict->put_in_force ||
                                        (verdict->undecided && !is_doubt(verdict->held_back)));
  std::string message = verdict->message + candidate.remarks;
  if (may_release && !released)
    message += fmt::format("; what was in quarantine of {} stays there",
                           fmt::join(candidate.job.batch_ids, ", "));
  JobOutcome outcome = outcome_of(*verdict);
  outcome.peak_memory = candidate.peak_memory;
  outcome.processor_time = candidate.processor_time;
  return Judged{verdict->put_in_force, released, std::move(message), std::move(outcome)};
}

Result<Kept> ModelHistory::keep(const Candidate& candidate, const Judging& judging,
                                const std::stop_token& stop) {
  const std::string& cell = candidate.job.cell;
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    if (stop.stop_requested()) return failure(ErrorCode::kBusy, "the service stops");
    // The version of the record, since the registry may have a replacement for a version that
    // cannot be loaded here.
    const auto recorded = TRY(store_.version_in_force(cell));
    if (store_.is_shared())
      static_cast<void>(follow(cell));  // otherwise the store refuses a verdict that was made
                                        // against another version
    // Judging takes a while, so it happens without the lock. It is repeated if somebody changed the
    // version in force meanwhile.
    const auto present = registry_.in_force(cell);
    const int version = present ? present->version : 0;
    auto found = TRY(judged(candidate, judging, present.get()));
    const MutexLock lock(changes_of(cell));
    if (registry_.version_in_force(cell) != version) continue;
    auto kept = store(candidate, found, recorded.value_or(0));
    const bool changed_elsewhere = !kept && kept.error().code == ErrorCode::kConflict;
    if (!changed_elsewhere) return kept;
  }
  const MutexLock lock(changes_of(cell));
  const auto recorded = TRY(store_.version_in_force(cell));
  auto found = TRY(judged(candidate, judging, registry_.in_force(cell).get()));
  auto kept = store(candidate, std::move(found), recorded.value_or(0));
  // The lock holds up this server's decisions only. If others change the version all the time, that
  // is not a fault of the model.
  if (!kept && kept.error().code == ErrorCode::kConflict && store_.is_shared())
    return failure(ErrorCode::kBusy, "cell {}: what is in force changes all the time", cell)
        .next("try again later");
  return kept;
}

Result<Kept> ModelHistory::store(const Candidate& candidate, Judged judged, int expected) {
  const std::string& cell = candidate.job.cell;
  ChangeId decided;
  // With a single server, the cell's lock guarantees the same.
  if (judged.put_in_force && store_.is_shared()) decided.expected_version = expected;
  const auto version = TRY(store_.add_model(cell, {candidate.model, candidate.text},
                                            candidate.job.id, judged.put_in_force, judged.message,
                                            judged.release, decided, judged.outcome));
  auto served = registry_.reclaimed({cell, version, candidate.model});
  if (judged.put_in_force) {
    put_in_force(std::move(served));
  } else if (listener_) {
    listener_(*served, false);
  }
  return Kept{version, judged.put_in_force, std::move(judged.message), std::move(judged.outcome)};
}

void ModelHistory::put_in_force(ServedModelPtr model) {
  set_trouble(model->cell, std::nullopt);
  registry_.publish(model);
  if (listener_) listener_(*model, true);
}

Result<Opponents> ModelHistory::opponents(const std::string& cell,
                                          const ServedModel* present) const {
  Opponents opponents;
  opponents.most_before = kMostServedBefore;
  if (present != nullptr) {
    auto text = store_.model_text(cell, present->version);
    opponents.in_force =
        ModelText{present->version, text ? std::move(*text) : serialize(present->model)};
  }
  auto before = TRY(served_before(cell));
  opponents.served_before = std::move(before);
  const auto record = TRY(record_not_loaded(cell));
  opponents.record = record;
  return opponents;
}

Result<std::vector<ModelText>> ModelHistory::served_before(const std::string& cell) const {
  const auto versions = store_.previous_in_force(cell);
  std::vector<ModelText> served;
  if (!versions) {
    if (versions.error().code == ErrorCode::kNotFound) return served;
    return tl::make_unexpected(versions.error());
  }
  for (const int version : *versions) {
    if (served.size() >= kMostReadBefore) break;
    if (auto text = store_.model_text(cell, version)) served.push_back({version, std::move(*text)});
  }
  return served;
}

Result<std::optional<RecordInForce>> ModelHistory::record_not_loaded(
    const std::string& cell) const {
  if (registry_.in_force(cell)) return std::nullopt;
  const auto models = TRY(store_.models(cell));
  const auto marked =
      std::find_if(models.begin(), models.end(), [](const StoredModel& m) { return m.in_force; });
  // A version that loads was set aside for its robot or tools, so its figures do not compare with
  // others.
  if (marked == models.end() || store_.model(cell, marked->version)) return std::nullopt;
  return RecordInForce{marked->version, marked->validation_rms};
}

}  // namespace trammel
