// The decisions of people about a cell: which version is in force, and which batches may be learned
// from.
#include <set>
#include <utility>

#include "server/base/units.h"
#include "server/tasks/accept/judging.h"
#include "server/tasks/accept/verdict.h"
#include "server/trainer/compute/job_batches.h"
#include "server/trainer/job_sources.h"
#include "server/trainer/trainer.h"

namespace trammel {

Status Trainer::activate(const std::string& cell, int version, const ChangeId& id, bool force) {
  const auto made = TRY(store_.outcome_of(id));
  if (made) return {};
  const auto as_judged = [&](const ChangeId& decided) -> Status {
    TRY(store_.check_expected(cell, decided));
    const auto judged = judged_beside_present(cell, version);
    if (!judged && !force) return tl::make_unexpected(judged.error());
    const std::optional<GateVerdict> verdict = judged ? *judged : std::nullopt;
    const Status wanted = verdict && !force ? check_not_worse(cell, version, *verdict) : Status();
    return wanted ? history_.activate(cell, version, decided, verdict) : wanted;
  };
  if (!store_.is_shared()) return as_judged(id);
  // Attempts to judge against the version in force, which others may change meanwhile.
  constexpr int kMostAttempts = 8;
  for (int attempt = 1;; ++attempt) {
    static_cast<void>(history_.follow(cell));
    const auto recorded = TRY(store_.version_in_force(cell));
    ChangeId decided = id;
    if (!decided.expected_version) decided.expected_version = recorded.value_or(0);
    const Status done = as_judged(decided);
    const bool changed_meanwhile =
        !done && !id.expected_version && done.error().code == ErrorCode::kConflict;
    if (!changed_meanwhile || attempt == kMostAttempts) return done;
  }
}

Result<std::optional<GateVerdict>> Trainer::judged_beside_present(const std::string& cell_name,
                                                                  int version) const {
  const std::optional<GateVerdict> nothing_to_judge;
  const auto cell = TRY(cells_.find(cell_name));
  const auto present = registry_.in_force(cell_name);
  if (!present || present->version == version) return nothing_to_judge;
  const auto asked = TRY(registry_.version(cell_name, version));
  const auto own = TRY(store_.batches_of_version(cell_name, version));
  const auto sources = TRY(judging_sources(store_, cell_name, own));
  if (sources.empty()) return nothing_to_judge;  // a person decides, and has
  JobBatches batches(*cell, held_out_by_service(options_.validation_share, options_.seed),
                     options_.compute.reads, {});
  for (const BatchSource& source : sources) {
    const auto stored = TRY(store_.batch(cell_name, source.id));
    batches.add({source.id, stored.csv, stored.accepted_at}, true);
  }
  GateVerdict verdict = verdict_on(asked->model, present.get(), {}, {}, batches.judging_sessions(),
                                   {Bar::kBetter, options_.accept_ratio});
  verdict.why += fmt::format(" (judged by what {} batches hold out, the newest is {})",
                             sources.size(), sources.back().id);
  return std::optional(std::move(verdict));
}

Status Trainer::check_not_worse(const std::string& cell, int version,
                                const GateVerdict& verdict) const {
  const GateFigures& figures = verdict.figures;
  const bool has_figures = figures.before && figures.after;
  if (verdict.put_in_force ||
      (has_figures && *figures.after <= options_.accept_ratio * *figures.before))
    return {};
  const auto made_here = TRY(store_.was_made_by_job(cell, version));
  // The job that made the version has already reported that it could not be judged, so the caller
  // knows. A version that few judging rows find far worse is refused anyway.
  const bool far_worse = has_figures && is_far_worse(*figures.before, *figures.after);
  if (made_here && !far_worse && (verdict.undecided || !has_figures)) return {};
  const char* how = has_figures ? "worse than" : "not known to be as good as";
  Failure worse =
      refused("cell {}: version {} is {} version {}, which is in force: {}", cell, version, how,
              registry_.version_in_force(cell), verdict.why)
          .of(has_figures ? "after_mm" : "version")
          .next(fmt::format(
              "trammel activate --service --model {}@{} --force puts it in force all the same",
              cell, version));
  if (!has_figures) return std::move(worse).with_value(version);
  const double limit = options_.accept_ratio * *figures.before;
  return std::move(worse).beyond(to_mm(*figures.after), to_mm(limit));
}

Status Trainer::release(const std::string& cell_name, const std::string& batch_id,
                        const ChangeId& id) {
  TRY(cells_.find(cell_name));
  return store_.set_quarantine(cell_name, batch_id, "", id);
}

Status Trainer::discard(const std::string& cell_name, const std::string& batch_id,
                        const ChangeId& id) {
  TRY(cells_.find(cell_name));
  return store_.discard(cell_name, batch_id, id);
}

}  // namespace trammel
