#include "server/diagnose/diagnose.h"

#include <algorithm>

#include "server/base/hash.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/orientation_check.h"
#include "server/diagnose/evidence/dependence.h"
#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/more_than_noise.h"
#include "server/diagnose/tell/next_poses.h"
#include "server/diagnose/tell/wording.h"
#include "server/measurement/velocity.h"

namespace trammel {

namespace {

constexpr int kFewestPoses = 12;

Error given_up() { return failure(ErrorCode::kBusy, "diagnosis given up on request").value(); }

bool reported(const DiagnoseOptions& options, const std::string& stage, double share) {
  return !options.progress || options.progress(stage, share);
}

/// Poses in the order in which they were measured, where their times say another one than their rows. True where
/// something had to be moved; what begins at a pose is then told by its pose id, not by a row.
bool put_in_order_of_time(MeasurementBatch& batch) {
  const auto time = [](const Measurement& m) { return m.context.time; };
  if (!std::all_of(batch.measurements.begin(), batch.measurements.end(),
                   [&](const auto& m) { return time(m).has_value(); }))
    return false;
  const auto earlier = [&](const Measurement& a, const Measurement& b) { return *time(a) < *time(b); };
  if (std::is_sorted(batch.measurements.begin(), batch.measurements.end(), earlier)) return false;
  std::stable_sort(batch.measurements.begin(), batch.measurements.end(), earlier);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) batch.measurements[i].context.index = static_cast<int>(i);
  return true;
}

Result<PreparedBatch> prepare(const Cell& cell, const MeasurementBatch& batch, std::uint64_t seed) {
  Result<MeasurementBatch> checked = check_against_cell(batch, cell);
  if (!checked) return tl::make_unexpected(checked.error());
  if (const Status oriented = check_orientations(*checked, cell); !oriented)
    return tl::make_unexpected(oriented.error());
  PreparedBatch prepared;
  prepared.sorted = put_in_order_of_time(*checked);
  fill_velocity(*checked);
  BatchSplit split = split_batch(*checked, 0, seed);
  MergedRepeats merged = merge_repeats(split.train, cell.tracker.sigma);
  prepared.surrogates = put_in_surrogates(*checked);
  take_over_surrogates(prepared.surrogates, *checked, merged.batch);
  take_over_surrogates(prepared.surrogates, *checked, split.validation);
  const std::size_t poses = merged.batch.measurements.size();
  if (poses < static_cast<std::size_t>(kFewestPoses)) {
    const std::size_t held_out = split.validation.measurements.size();
    return refused("{} poses to diagnose{}, at least {}", poses,
                   held_out > 0 ? fmt::format(" beside {} held out", held_out) : "", kFewestPoses)
        .in("batch " + batch.id)
        .beyond(poses, kFewestPoses);
  }
  prepared.train = std::move(merged.batch);
  prepared.validation = std::move(split.validation);
  prepared.repeats = merged.statistics;
  return prepared;
}

MeasurementBatch as_recorded(const Surrogates& surrogates, MeasurementBatch batch) {
  take_out_surrogates(surrogates, batch);
  return batch;
}

}  // namespace

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                           const DiagnoseOptions& options) {
  const Result<PreparedBatch> prepared = prepare(*cell, batch, options.seed);
  if (!prepared) return tl::make_unexpected(prepared.error());
  if (!reported(options, "calibrating", 0)) return tl::make_unexpected(given_up());
  Result<SearchResult> searched =
      search_causes(cell, with_unknown_tool(cell->model.error_sources, *cell), prepared->train, options);
  if (!searched) return tl::make_unexpected(searched.error());
  if (!reported(options, "measuring the gain", 0.65)) return tl::make_unexpected(given_up());
  const Explained explained(*cell, std::move(*searched));
  const SearchResult& found = explained.found;
  const MeasurementBatch recorded = as_recorded(prepared->surrogates, found.batch);

  Diagnosis diagnosis;
  tell_errors(explained, *prepared, diagnosis);
  tell_findings(explained, *prepared, recorded, diagnosis);
  tell_noise(explained, *prepared, diagnosis);
  tell_sources(found, prepared->sorted, diagnosis);
  tell_held_out(explained, *prepared, diagnosis);
  if (!reported(options, "asking what could not have been seen", 0.72)) return tl::make_unexpected(given_up());
  const std::vector<FamilyPtr> families = make_families(explained.after);
  tell_blindness(explained, families, *cell, prepared->surrogates, recorded, diagnosis);
  tell_periodograms(explained, diagnosis);
  if (!reported(options, "planning the next poses", 0.8)) return tl::make_unexpected(given_up());
  diagnosis.next_poses = next_poses_for(found, explained.before, options);
  if (diagnosis.next_poses.q.empty()) diagnosis.next_poses.none_because = why_no_next_poses(diagnosis.findings);
  if (options.recovery) {
    if (!reported(options, "hiding effects in the poses", 0.85)) return tl::make_unexpected(given_up());
    tell_recovery(explained, families, options.seed + 2, diagnosis);
  }
  if (!reported(options, "looking at what is left", 0.95)) return tl::make_unexpected(given_up());
  diagnosis.leftover =
      dependence_of(explained.after, explained.all, explained.all.project(explained.after.residual()), options.seed);
  tell_limits(explained, *prepared, as_recorded(prepared->surrogates, found.all), diagnosis);
  diagnosis.batch = recorded;
  diagnosis.batch_hash = batch_hash(batch);
  diagnosis.cell_hash = sha256_hex(cell->cell_yaml + cell->robot_yaml);
  diagnosis.seed = options.seed;
  diagnosis.sentence = sentence_for(diagnosis);
  return diagnosis;
}

}  // namespace trammel
