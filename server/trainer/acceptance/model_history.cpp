#include "server/trainer/acceptance/model_history.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/trainer/acceptance/fits_cell.h"

namespace trammel {

namespace {

constexpr int kMostAttempts = 8;              // where others change what is in force meanwhile
constexpr std::size_t kMostServedBefore = 4;  // versions that a new one is held against besides the one in force

/// Where among `sessions` those begin that came after `model` was trained: behind its own batches, or, where none of
/// these is among them, behind all that was measured before it.
std::size_t first_new(const std::vector<JudgingSession>& sessions, const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  const auto behind = [&](const auto& is_old) {
    return static_cast<std::size_t>(sessions.rend() - std::find_if(sessions.rbegin(), sessions.rend(), is_old));
  };
  const std::size_t own = behind([&](const JudgingSession& one) { return one.batch_id == provenance.batch_id; });
  if (own > 0) return own;
  const std::string several = "+" + provenance.batch_id + "+";  // joined by plus signs
  const std::size_t last =
      behind([&](const JudgingSession& one) { return several.find("+" + one.batch_id + "+") != std::string::npos; });
  if (last > 0) return last;
  const std::int64_t made_at = provenance.measured_at.value_or(provenance.trained_at);
  return behind([&](const JudgingSession& session) { return session.training.measured_at.value_or(0) <= made_at; });
}

/// Where the version marked in force cannot be asked: against what its own held-out poses said when it was made.
GateVerdict judge_by_record(const CompensatedModel& candidate, const StoredModel& record,
                            const std::vector<JudgingSession>& sessions, double accept_ratio, GateVerdict otherwise) {
  double sum = 0;
  Eigen::Index count = 0;
  for (const JudgingSession& session : sessions) {
    const LocatedErrors errors = located_errors(candidate, session);
    for (Eigen::Index i = 0; i < errors.position.cols(); ++i) {
      if (!errors.position.col(i).allFinite()) continue;
      sum += errors.position.col(i).squaredNorm();
      ++count;
    }
  }
  const double rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0;
  if (record.validation_rms == 0 || rms <= accept_ratio * record.validation_rms) return otherwise;
  const std::string why = fmt::format(
      "held-out rms {:.4f} mm, limit {} x {:.4f} mm that version {} had on its own, which is marked in force but "
      "cannot "
      "be loaded",
      to_mm(rms), accept_ratio, to_mm(record.validation_rms), record.version);
  const double limit = accept_ratio * record.validation_rms;
  return {false, "not in force: " + why + "; activate it if it is wanted", false, why, {{}, rms, limit}};
}

JobOutcome outcome_of(const GateVerdict& verdict) {
  JobOutcome outcome;
  outcome.verdict = verdict.put_in_force ? JobVerdict::kInForce
                    : verdict.undecided  ? JobVerdict::kUndecided
                                         : JobVerdict::kNotBetter;
  outcome.before = verdict.figures.before;
  outcome.after = verdict.figures.after;
  outcome.limit = verdict.figures.limit;
  outcome.why = verdict.why;
  if (!verdict.put_in_force) outcome.next = "activate it if it is wanted";
  return outcome;
}

}  // namespace

ModelHistory::ModelHistory(const ServedCells& cells, Store& store, ModelRegistry& registry, double accept_ratio)
    : cells_(cells), store_(store), registry_(registry), accept_ratio_(accept_ratio) {
  for (const auto& [name, cell] : cells_) changing_[name];
}

Status ModelHistory::publish_from_store(const std::string& cell) {
  const auto version = store_.version_in_force(cell);
  if (!version) return tl::make_unexpected(version.error());
  if (!*version) return {};
  auto model = load_for_service(cell, **version);
  if (!model) return tl::make_unexpected(model.error());
  const MutexLock lock(changes_of(cell));
  put_in_force({cell, **version, std::move(*model)});
  return {};
}

Result<CompensatedModel> ModelHistory::load_for_service(const std::string& cell, int version) const {
  auto model = store_.model(cell, version);
  if (!model) return model;
  const Status fits = check_fits_cell(*model, *cells_.at(cell), fmt::format("version {} of cell {}", version, cell));
  if (!fits) return tl::make_unexpected(fits.error());
  return model;
}

Status ModelHistory::check_expected(const std::string& cell, const ChangeRequest& request) const {
  if (!request.expected) return {};
  const auto served = registry_.in_force(cell);
  const int version = served ? served->version : 0;
  if (version == *request.expected) return {};
  return failure(ErrorCode::kConflict, "cell {}: version {} is in force, not {} as expected", cell, version,
                 *request.expected)
      .of("expected")
      .beyond(*request.expected, version)
      .next("look again, and decide anew");
}

Status ModelHistory::activate(const std::string& cell, int version, const ChangeRequest& request) {
  if (auto found = find_cell(cells_, cell); !found) return tl::make_unexpected(found.error());
  const auto made = store_.outcome_of(request.id);
  if (!made) return tl::make_unexpected(made.error());
  if (*made) return {};
  auto model = load_for_service(cell, version);
  if (!model) return tl::make_unexpected(model.error());
  const MutexLock lock(changes_of(cell));
  const auto made_meanwhile = store_.outcome_of(request.id);
  if (!made_meanwhile) return tl::make_unexpected(made_meanwhile.error());
  if (*made_meanwhile) return {};
  if (auto as_expected = check_expected(cell, request); !as_expected) return as_expected;
  if (auto activated = store_.activate(cell, version, request.id); !activated) return activated;
  const auto served = registry_.in_force(cell);
  if (!served || served->version != version) put_in_force({cell, version, std::move(*model)});
  return {};
}

Result<ModelHistory::WayBack> ModelHistory::way_back(const std::string& cell) const {
  auto before = store_.previous_in_force(cell);
  if (!before) return tl::make_unexpected(before.error());
  const auto now = store_.version_in_force(cell);
  if (!now) return tl::make_unexpected(now.error());
  return WayBack{now->value_or(0), std::move(*before)};
}

Result<std::pair<int, CompensatedModel>> ModelHistory::load_first(const std::string& cell,
                                                                  const std::vector<int>& before) const {
  std::optional<Error> why_not;
  for (std::size_t i = 0; i < before.size(); ++i) {
    auto model = load_for_service(cell, before[i]);
    if (model) return std::pair(static_cast<int>(i) + 1, std::move(*model));
    if (!why_not) why_not = model.error();
  }
  return tl::make_unexpected(*why_not);
}

Result<int> ModelHistory::rollback(const std::string& cell, const ChangeRequest& request) {
  if (auto found = find_cell(cells_, cell); !found) return tl::make_unexpected(found.error());
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    const auto made = store_.outcome_of(request.id);
    if (!made) return tl::make_unexpected(made.error());
    if (*made) return (*made)->version;
    // Loading takes a while: nobody waits for it.
    const auto way = way_back(cell);
    if (!way) return tl::make_unexpected(way.error());
    auto found = load_first(cell, way->before);
    if (!found) return tl::make_unexpected(found.error());
    const MutexLock lock(changes_of(cell));
    if (const auto now = way_back(cell); !now || *now != *way) continue;
    if (auto as_expected = check_expected(cell, request); !as_expected) return tl::make_unexpected(as_expected.error());
    const auto restored = store_.rollback(cell, found->first, request.id);
    if (!restored) return restored;
    put_in_force({cell, *restored, std::move(found->second)});
    return restored;
  }
  return failure(ErrorCode::kBusy, "cell {}: what is in force changes all the time", cell).next("try again later");
}

Result<int> ModelHistory::import_model(const std::string& cell, const std::string& text, const ChangeId& id) {
  const auto cell_found = find_cell(cells_, cell);
  if (!cell_found) return tl::make_unexpected(cell_found.error());
  const auto model = deserialize(text, "imported model");
  if (!model) return tl::make_unexpected(model.error());
  if (model->cell().name != cell) {
    return refused("imported model {} is of cell {}, not {}", model->provenance().id, model->cell().name, cell)
        .of("cell")
        .with_text(model->cell().name);
  }
  const Status fits = check_fits_cell(*model, **cell_found, "imported model " + model->provenance().id);
  if (!fits) return tl::make_unexpected(fits.error());
  const MutexLock lock(changes_of(cell));
  const auto present = store_.models(cell);
  if (!present) return tl::make_unexpected(present.error());
  for (const StoredModel& stored : *present) {
    if (stored.hash == model->provenance().hash) return stored.version;
  }
  const auto version = store_.add_model(cell, *model, 0, false, "", false, id);
  if (version && listener_) listener_({cell, *version, *model}, false);
  return version;
}

Result<ModelHistory::Judged> ModelHistory::judged(const Candidate& candidate, const ServedModel* present) const {
  const auto may_release = store_.may_release(candidate.job.id);
  if (!may_release) return tl::make_unexpected(may_release.error());
  const auto verdict = this->verdict(candidate, present);
  if (!verdict) return tl::make_unexpected(verdict.error());
  const bool released = *may_release && (verdict->put_in_force || verdict->undecided);
  std::string message = verdict->message + candidate.remarks;
  if (*may_release && !released)
    message += fmt::format("; what was in quarantine of {} stays there", fmt::join(candidate.job.batch_ids, ", "));
  return Judged{verdict->put_in_force, released, std::move(message), outcome_of(*verdict)};
}

Result<Kept> ModelHistory::keep(const Candidate& candidate, const std::stop_token& stop) {
  const std::string& cell = candidate.job.cell;
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    if (stop.stop_requested()) return failure(ErrorCode::kBusy, "the service stops");
    // Judging takes a while: nobody waits for it. Where somebody changed what is in force meanwhile, it is done again.
    const auto present = registry_.in_force(cell);
    auto found = judged(candidate, present.get());
    if (!found) return tl::make_unexpected(found.error());
    const MutexLock lock(changes_of(cell));
    if (registry_.in_force(cell) == present) return store(candidate, std::move(*found));
  }
  const MutexLock lock(changes_of(cell));
  auto found = judged(candidate, registry_.in_force(cell).get());
  if (!found) return tl::make_unexpected(found.error());
  return store(candidate, std::move(*found));
}

Result<Kept> ModelHistory::store(const Candidate& candidate, Judged judged) {
  const std::string& cell = candidate.job.cell;
  const auto version = store_.add_model(cell, candidate.model, candidate.job.id, judged.put_in_force, judged.message,
                                        judged.release, {}, judged.outcome);
  if (!version) return tl::make_unexpected(version.error());
  ServedModel served{cell, *version, candidate.model};
  if (judged.put_in_force) {
    put_in_force(std::move(served));
  } else if (listener_) {
    listener_(served, false);
  }
  return Kept{*version, judged.put_in_force, std::move(judged.message), std::move(judged.outcome)};
}

void ModelHistory::put_in_force(ServedModel model) {
  const auto served = std::make_shared<const ServedModel>(std::move(model));
  registry_.publish(served);
  if (listener_) listener_(*served, true);
}

Result<GateVerdict> ModelHistory::verdict(const Candidate& candidate, const ServedModel* present) const {
  const std::string& cell = candidate.job.cell;
  auto before = served_before(cell);
  if (!before) return tl::make_unexpected(before.error());
  GateQuestion question{candidate.model, present, std::move(*before), candidate.sessions, 0};
  if (present != nullptr) question.first_new = first_new(candidate.sessions, present->model);
  GateVerdict verdict = judge(question, {candidate.bar, accept_ratio_});
  if (!verdict.put_in_force) return verdict;
  const auto record = record_not_loaded(cell);
  if (!record) return tl::make_unexpected(record.error());
  if (!*record) return verdict;
  return judge_by_record(candidate.model, **record, candidate.sessions, accept_ratio_, std::move(verdict));
}

Result<std::vector<ServedModel>> ModelHistory::served_before(const std::string& cell) const {
  const auto versions = store_.previous_in_force(cell);
  std::vector<ServedModel> served;
  if (!versions) {
    if (versions.error().code == ErrorCode::kNotFound) return served;
    return tl::make_unexpected(versions.error());
  }
  for (const int version : *versions) {
    if (served.size() >= kMostServedBefore) break;
    if (auto model = load_for_service(cell, version)) served.push_back({cell, version, std::move(*model)});
  }
  return served;
}

Result<std::optional<StoredModel>> ModelHistory::record_not_loaded(const std::string& cell) const {
  if (registry_.in_force(cell)) return std::nullopt;
  const auto models = store_.models(cell);
  if (!models) return tl::make_unexpected(models.error());
  const auto marked = std::find_if(models->begin(), models->end(), [](const StoredModel& m) { return m.in_force; });
  // One that can be loaded was set aside for its robot or tools: its figures say nothing about others.
  if (marked == models->end() || store_.model(cell, marked->version)) return std::nullopt;
  return *marked;
}

}  // namespace trammel
