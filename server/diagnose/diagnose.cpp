#include "server/diagnose/diagnose.h"

#include <algorithm>
#include <functional>

#include "server/base/hash.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/orientation_check.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/search.h"
#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/more_than_noise.h"
#include "server/diagnose/tell/wording.h"
#include "server/measurement/velocity.h"

namespace trammel::cause_search {

namespace {

constexpr std::size_t kFewestPoses =
    12;  // a base and a tool are 12 numbers; with fewer poses little is left to look at

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

/// Refuses what cannot be diagnosed.
Result<MeasurementBatch> checked(const Cell& cell, const MeasurementBatch& batch) {
  Result<MeasurementBatch> checked = check_against_cell(batch, cell);
  if (!checked) return checked;
  if (const Status oriented = check_orientations(*checked, cell); !oriented)
    return tl::make_unexpected(oriented.error());
  return checked;
}

Result<PreparedBatch> prepare(const Cell& cell, const MeasurementBatch& batch, std::uint64_t seed) {
  Result<MeasurementBatch> whole = checked(cell, batch);
  if (!whole) return tl::make_unexpected(whole.error());
  PreparedBatch prepared;
  prepared.sorted = put_in_order_of_time(*whole);
  fill_velocity(*whole);
  BatchSplit split = split_batch(*whole, 0, seed);
  MergedRepeats merged = merge_repeats(split.train, cell.tracker.sigma);
  prepared.surrogates = put_in_surrogates(*whole);
  take_over_surrogates(prepared.surrogates, *whole, merged.batch);
  take_over_surrogates(prepared.surrogates, *whole, split.validation);
  const std::size_t poses = merged.batch.measurements.size();
  if (poses < kFewestPoses) {
    const std::size_t held_out = split.validation.measurements.size();
    return refused("batch {}: {} poses to diagnose{}, at least {}", batch.id, poses,
                   held_out > 0 ? fmt::format(" beside {} held out", held_out) : "", kFewestPoses);
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

/// One part of the work after the search.
struct Step {
  std::string what;            ///< for the line of progress
  double share = 0;            ///< of all the work, done before it
  std::function<void()> tell;  ///< fills its part of the diagnosis
};

/// Runs the steps one after the other. Busy where the caller gives up in between.
Status run(const std::vector<Step>& steps, const DiagnoseOptions& options) {
  for (const Step& step : steps) {
    if (Status wanted = report_progress(options, step.what, step.share); !wanted) return wanted;
    step.tell();
  }
  return {};
}

Result<SearchResult> searched(const std::shared_ptr<const Cell>& cell, const PreparedBatch& prepared,
                              const DiagnoseOptions& options) {
  const Status wanted = report_progress(options, "calibrating", 0);
  if (!wanted) return tl::make_unexpected(wanted.error());
  Result<SearchResult> result =
      search_causes(cell, with_unknown_tool(cell->model.error_sources, *cell), prepared.train, options);
  if (!result) return result;
  const Status go_on = report_progress(options, "measuring the gain", 0.65);
  if (!go_on) return tl::make_unexpected(go_on.error());
  return result;
}

/// What was done to which files.
void tell_provenance(const Cell& cell, const MeasurementBatch& batch, std::uint64_t seed, Diagnosis& diagnosis) {
  diagnosis.batch_hash = batch_hash(batch);
  diagnosis.cell_hash = sha256_hex(cell.cell_yaml + cell.robot_yaml);
  diagnosis.seed = seed;
}

Result<Diagnosis> diagnosed(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                            const DiagnoseOptions& options) {
  const Result<PreparedBatch> prepared = prepare(*cell, batch, options.seed);
  if (!prepared) return tl::make_unexpected(prepared.error());
  Result<SearchResult> result = searched(cell, *prepared, options);
  if (!result) return tl::make_unexpected(result.error());
  const Explained explained(*cell, std::move(*result));
  const SearchResult& found = explained.found;
  const std::vector<FamilyPtr> families = make_families(explained.after);

  Diagnosis diagnosis;
  diagnosis.batch = as_recorded(prepared->surrogates, found.batch);
  tell_provenance(*cell, batch, options.seed, diagnosis);
  tell_errors(explained, *prepared, diagnosis);
  tell_findings(explained, *prepared, diagnosis.batch, diagnosis);
  tell_noise(explained, *prepared, diagnosis);
  tell_sources(found, prepared->sorted, diagnosis);
  tell_held_out(explained, *prepared, diagnosis);

  std::vector<Step> steps;
  steps.push_back({"asking what could not have been seen", 0.72, [&] {
                     tell_blindness(explained, families, *cell, prepared->surrogates, diagnosis.batch, diagnosis);
                     tell_periodograms(explained, diagnosis);
                   }});
  steps.push_back({"planning the next poses", 0.8, [&] { tell_next_poses(explained, options, diagnosis); }});
  if (options.recovery) {
    steps.push_back({"hiding effects in the poses", 0.85,
                     [&] { tell_recovery(explained, families, options.seed + kRecoveryDraw, diagnosis); }});
  }
  steps.push_back({"looking at what is left", 0.95, [&] {
                     tell_left_over(explained, options.seed, diagnosis);
                     tell_limits(explained, *prepared, as_recorded(prepared->surrogates, found.all), diagnosis);
                   }});
  if (const Status done = run(steps, options); !done) return tl::make_unexpected(done.error());
  diagnosis.sentence = sentence_for(diagnosis);
  return diagnosis;
}

}  // namespace

}  // namespace trammel::cause_search

namespace trammel {

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                           const DiagnoseOptions& options) {
  return cause_search::diagnosed(cell, batch, options);
}

}  // namespace trammel
