#include "server/diagnose/diagnose.h"

#include <functional>

#include "server/base/hash.h"
#include "server/calibrate/batch_check.h"
#include "server/calibrate/frames/frames.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/search.h"
#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/more_than_noise.h"
#include "server/diagnose/tell/wording.h"

namespace trammel::cause_search {

namespace {

constexpr std::size_t kFewestPoses =
    12;  // a base and a tool are 12 numbers; with fewer poses little is left to look at

Result<PreparedBatch> prepare(const Cell& cell, const CheckedBatch& batch) {
  if (auto doubt = reading_doubt(batch.rows(), cell)) return Failure(std::move(*doubt)).in("batch " + batch.id());
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
  if (poses < kFewestPoses) {
    const std::size_t held_out = prepared.validation.measurements.size();
    return refused("{} poses to diagnose{}, at least {}", poses,
                   held_out > 0 ? fmt::format(" beside {} held out", held_out) : "", kFewestPoses)
        .in("batch " + batch.id())
        .beyond(poses, kFewestPoses);
  }
  prepared.train = std::move(merged.batch);
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
void tell_provenance(const Cell& cell, const CheckedBatch& batch, std::uint64_t seed, Diagnosis& diagnosis) {
  diagnosis.batch_hash = batch.hash();
  diagnosis.cell_hash = sha256_hex(cell.cell_yaml + cell.robot_yaml);
  diagnosis.seed = seed;
}

Result<Diagnosis> diagnosed(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                            const DiagnoseOptions& options) {
  const Result<PreparedBatch> prepared = prepare(*cell, batch);
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

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                           const DiagnoseOptions& options) {
  return cause_search::diagnosed(cell, batch, options);
}

}  // namespace trammel
