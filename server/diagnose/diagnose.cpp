#include "server/diagnose/diagnose.h"

#include "server/base/hash.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/orientation_check.h"
#include "server/diagnose/evidence/dependence.h"
#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/more_than_noise.h"
#include "server/diagnose/tell/next_poses.h"
#include "server/diagnose/tell/wording.h"

namespace trammel {

namespace {

constexpr int kFewestPoses = 12;

Failure given_up() { return failure(ErrorCode::kBusy, "diagnosis given up on request"); }

bool reported(const DiagnoseOptions& options, const std::string& stage, double share) {
  return !options.progress || options.progress(stage, share);
}

Result<PreparedBatch> prepare(const Cell& cell, const CheckedBatch& batch) {
  if (const Status oriented = check_orientations(batch.rows(), cell); !oriented)
    return tl::make_unexpected(oriented.error());
  PreparedBatch prepared;
  // Where rows had to be moved, what begins at a pose is told by its pose id, not by a row.
  prepared.sorted = !batch.is_in_order_of_time();
  const CheckedBatch ordered = batch.in_order_of_time();
  MeasurementBatch all = ordered.rows();
  MergedRepeats merged = merge_repeats(ordered.training(), cell.tracker.sigma);
  prepared.validation = ordered.held_out();
  prepared.surrogates = put_in_surrogates(all);
  take_over_surrogates(prepared.surrogates, all, merged.batch);
  take_over_surrogates(prepared.surrogates, all, prepared.validation);
  const std::size_t poses = merged.batch.measurements.size();
  if (poses < static_cast<std::size_t>(kFewestPoses)) {
    const std::size_t held_out = prepared.validation.measurements.size();
    return refused("batch {}: {} poses to diagnose{}, at least {}", batch.id(), poses,
                   held_out > 0 ? fmt::format(" beside {} held out", held_out) : "", kFewestPoses);
  }
  prepared.train = std::move(merged.batch);
  prepared.repeats = merged.statistics;
  return prepared;
}

MeasurementBatch as_recorded(const Surrogates& surrogates, MeasurementBatch batch) {
  take_out_surrogates(surrogates, batch);
  return batch;
}

}  // namespace

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                           const DiagnoseOptions& options) {
  const Result<PreparedBatch> prepared = prepare(*cell, batch);
  if (!prepared) return tl::make_unexpected(prepared.error());
  if (!reported(options, "calibrating", 0)) return given_up();
  Result<SearchResult> searched =
      search_causes(cell, with_unknown_tool(cell->model.error_sources, *cell), prepared->train, options);
  if (!searched) return tl::make_unexpected(searched.error());
  if (!reported(options, "measuring the gain", 0.65)) return given_up();
  const Explained explained(*cell, std::move(*searched));
  const SearchResult& found = explained.found;
  const MeasurementBatch recorded = as_recorded(prepared->surrogates, found.batch);

  Diagnosis diagnosis;
  tell_errors(explained, *prepared, diagnosis);
  tell_findings(explained, *prepared, recorded, diagnosis);
  tell_noise(explained, *prepared, diagnosis);
  tell_sources(found, prepared->sorted, diagnosis);
  tell_held_out(explained, *prepared, diagnosis);
  if (!reported(options, "asking what could not have been seen", 0.72)) return given_up();
  const std::vector<FamilyPtr> families = make_families(explained.after);
  tell_blindness(explained, families, *cell, prepared->surrogates, recorded, diagnosis);
  tell_periodograms(explained, diagnosis);
  if (!reported(options, "planning the next poses", 0.8)) return given_up();
  diagnosis.next_poses = next_poses_for(found, explained.before, options);
  if (diagnosis.next_poses.q.empty()) diagnosis.next_poses.none_because = why_no_next_poses(diagnosis.findings);
  if (options.recovery) {
    if (!reported(options, "hiding effects in the poses", 0.85)) return given_up();
    tell_recovery(explained, families, options.seed + 2, diagnosis);
  }
  if (!reported(options, "looking at what is left", 0.95)) return given_up();
  diagnosis.leftover =
      dependence_of(explained.after, explained.all, explained.all.project(explained.after.residual()), options.seed);
  tell_limits(explained, *prepared, as_recorded(prepared->surrogates, found.all), diagnosis);
  diagnosis.batch = recorded;
  diagnosis.batch_hash = batch.hash();
  diagnosis.cell_hash = sha256_hex(cell->cell_yaml + cell->robot_yaml);
  diagnosis.seed = options.seed;
  diagnosis.sentence = sentence_for(diagnosis);
  return diagnosis;
}

}  // namespace trammel
