#include "server/diagnose/diagnose.h"

#include <algorithm>
#include <functional>

#include "server/base/check.h"
#include "server/base/hash.h"
#include "server/calibrate/agreement.h"
#include "server/calibrate/batch_check.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify_sessions.h"
#include "server/calibrate/jump.h"
#include "server/calibrate/one_session.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/file_doubts.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/prove/prove.h"
#include "server/diagnose/search/search.h"
#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/between_sessions.h"
#include "server/diagnose/tell/file_doubts_told.h"
#include "server/diagnose/tell/more_than_noise.h"
#include "server/diagnose/tell/row_mistakes.h"
#include "server/diagnose/tell/wording.h"
#include "server/error_sources/spelling.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"

namespace trammel::cause_search {

namespace {

constexpr std::size_t kFewestPoses =
    12;  // poses: base and tool have 12 numbers, so fewer leave little to examine

/// A batch of several sessions, and the places of its instruments.
struct Placed {
  CalibrationResult calibration;  ///< its sessions: where the instrument of each stood
  std::vector<Change> changes;    ///< of the arm between them
  bool as_given = false;          ///< no clock told their order

  [[nodiscard]] const std::vector<SessionSetting>& sessions() const { return calibration.sessions; }
};

/// The cell's sources, and the frames that the cell leaves open. A base that was placed by these
/// very poses stays free beside any other explanation.
std::vector<std::string> with_unknown_frames(const Cell& cell) {
  constexpr const char* kBase = "base";
  std::vector<std::string> sources = with_unknown_tool(cell.model.error_sources, cell);
  const bool is_listed = std::find(sources.begin(), sources.end(), kBase) != sources.end();
  if (!cell.X_WB && !is_listed) sources.insert(sources.begin(), kBase);
  return sources;
}

/// The cell's sources, and the play of every joint that was approached from both sides. Sessions
/// that came from different sides differ by play, which is not a change between them.
std::vector<std::string> sources_with_play(const Cell& cell, const MeasurementBatch& batch) {
  std::vector<std::string> sources = spelled_out(with_unknown_frames(cell), cell);
  for (const std::string& source : candidate_sources(cell, batch, nullptr)) {
    const bool is_play = cause_spelled(source).search == causes::SearchFamily::kPlay;
    if (is_play && std::find(sources.begin(), sources.end(), source) == sources.end())
      sources.push_back(source);
  }
  return sources;
}

/// The sessions placed by the arm with the cell's sources, and the changes on the arm between them.
/// A change must not count as noise of the sessions after it.
Result<Placed> placed(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                      const DiagnoseOptions& options) {
  if (!has_sessions(batch.rows())) return Placed();
  const MeasurementBatch merged = merge_repeats(batch.training(), cell->tracker.sigma).batch;
  const Identify identify = [&](const std::vector<std::string>& sources) {
    return calibrate(cell, sources, merged, {});
  };
  return identify_sessions(identify, sources_with_play(*cell, merged), merged,
                           [&](double) {
                             return report_progress(options,
                                                    "asking what changed between the sessions", 0);
                           })
      .map([&](IdentifiedSessions found) {
        return Placed{std::move(found.calibration), std::move(found.changes), !batch.rows().clock};
      });
}

/// The cause for an instrument that was set up anew.
const CauseRecord& set_up_anew() {
  const std::vector<const CauseRecord*> all = all_causes();
  const auto found = std::find_if(all.begin(), all.end(), [](const CauseRecord* cause) {
    return cause->lasting == causes::Lasting::kFromAPose && cause->scope == causes::Scope::kSession;
  });
  TRAMMEL_CHECK(found != all.end());
  return **found;
}

/// True if the search has no cause for a change of this kind, because it looks for changes that
/// begin at a pose and stay.
bool is_beside_the_search(const Change& change) {
  return is_of_one_session(change) || change.rate > 0;
}

/// The cell's sources, and a tracker that was set up anew from each session on, so that its effect
/// is not evidence. Changes between sessions that the search cannot name are added as well.
std::vector<std::string> sources_of(const Cell& cell, const Placed& placed) {
  std::vector<std::string> sources = with_unknown_frames(cell);
  for (std::size_t s = 1; s < placed.sessions().size(); ++s)
    sources.push_back(fmt::format("{}@{}", set_up_anew().spelling, placed.sessions()[s].first + 1));
  for (const Change& change : placed.changes) {
    if (!is_beside_the_search(change)) continue;
    for (std::string& source : change.sources()) sources.push_back(std::move(source));
  }
  return sources;
}

Result<PreparedBatch> prepare(const Cell& cell, const CheckedBatch& batch,
                              const std::vector<SessionSetting>& sessions) {
  TRY(require_positions(batch.rows(), "diagnose"));
  if (auto doubt = reading_doubt(batch.rows(), cell))
    return Failure(std::move(*doubt)).in("batch " + batch.id());
  PreparedBatch prepared;
  // If rows were moved, the beginning of a cause is reported by pose id, not by row.
  prepared.sorted = !batch.is_in_order_of_time();
  const CheckedBatch ordered = batch.in_order_of_time(cell.robot);
  prepared.sessions = with_noise_as_repeated(sessions, ordered.rows(), cell.tracker);
  const auto in_one_world = [&](const MeasurementBatch& rows) {
    return aligned(rows, prepared.sessions, cell.tracker);
  };
  MeasurementBatch all = in_one_world(ordered.rows());
  MergedRepeats merged = merge_repeats(in_one_world(ordered.training()), cell.tracker.sigma);
  prepared.validation = in_one_world(ordered.held_out());
  prepared.surrogates = put_in_surrogates(all, cell.robot);
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
  prepared.repeats = merged.statistics;
  prepared.vouched = vouched_by(merged.statistics);
  prepared.train = std::move(merged.batch);
  for (Measurement& m : prepared.train.measurements)
    if (m.sigma) *m.sigma *= prepared.vouched / merged.statistics.sigma_factor;
  return prepared;
}

MeasurementBatch as_recorded(const Surrogates& surrogates, MeasurementBatch batch) {
  take_out_surrogates(surrogates, batch);
  return batch;
}

/// One part of the work after the search.
struct Step {
  std::string what;            ///< for the line of progress
  double share = 0;            ///< share of the work that is done before it
  std::function<void()> tell;  ///< fills its part of the diagnosis
};

/// Runs the steps one after the other. Busy where the caller gives up in between.
Status run(const std::vector<Step>& steps, const DiagnoseOptions& options) {
  for (const Step& step : steps) {
    TRY(report_progress(options, step.what, step.share));
    step.tell();
  }
  return {};
}

/// Causes that a training adds by itself and that the search cannot see: without a payload,
/// compliant gears have no effect until the links have a weight. Their own effect is not evidence
/// of another cause.
std::vector<const CauseRecord*> added_unseen(const std::shared_ptr<const Cell>& cell,
                                             const std::vector<std::string>& sources,
                                             const MeasurementBatch& batch) {
  const auto& payloads = cell->payloads;
  if (std::any_of(payloads.begin(), payloads.end(),
                  [](const auto& one) { return one.second.mass > 0; }))
    return {};
  const Result<CalibrationResult> trained =
      calibrate(cell, sources, batch, {.held = {}, .weigh_links = true});
  std::vector<const CauseRecord*> added;
  for (std::size_t s = 0; trained && s < trained->model.sources.size(); ++s) {
    const CauseRecord& cause = trained->model.sources[s]->cause();
    const bool is_listed =
        std::find(sources.begin(), sources.end(), cause.spelling) != sources.end();
    if (cause.added_by_data && !cause.needs.temperature && !is_listed) added.push_back(&cause);
  }
  return added;
}

Result<SearchResult> searched(const std::shared_ptr<const Cell>& cell,
                              const PreparedBatch& prepared, const Placed& placed,
                              const DiagnoseOptions& options, Diagnosis& diagnosis) {
  TRY(report_progress(options, "calibrating", 0));
  std::vector<std::string> sources = sources_of(*cell, placed);
  for (const CauseRecord* cause : added_unseen(cell, sources, prepared.train)) {
    sources.emplace_back(cause->spelling);
    diagnosis.limits.push_back(fmt::format(
        "{} ({}): in no file, found from these poses as training finds it, and no finding here",
        in_words(std::string(cause->spelling)), cause->spelling));
  }
  Result<SearchResult> result = search_causes(cell, sources, prepared.train, options);
  if (!result) return result;
  TRY(report_progress(options, "measuring the gain", 0.65));
  return result;
}

/// True if `others` are off by much the same, as seen from the instrument or from the tool: a load
/// or a tool that nobody recorded shifts rows like that, and no mistake of single rows does.
bool are_off_alike(const CalibrationResult& found, const MeasurementBatch& others) {
  constexpr double kAlike = 0.5;  // of their rms: the mean of rows that err by themselves is less
  const MeasurementBatch here = aligned(others, found.sessions, found.model.cell->tracker);
  Vector3 mean_W = Vector3::Zero(), mean_T = Vector3::Zero();
  double square = 0;
  for (const Measurement& m : here.measurements) {
    const Pose X_WT = found.model.pose_W(m.context, found.model.values, nullptr);
    const Vector3 off = m.p_W - X_WT.translation();
    mean_W += off;
    mean_T += X_WT.linear().transpose() * off;
    square += off.squaredNorm();
  }
  const auto n = static_cast<double>(here.measurements.size());
  return std::max(mean_W.norm(), mean_T.norm()) / n > kAlike * std::sqrt(square / n);
}

/// Removes the rows that fit no arm on which the others agree, as a training does, and lists them
/// as suspects. Returns true if there are any. `plain`: the calibration on all rows, or why there
/// is none.
bool set_aside(const std::shared_ptr<const Cell>& cell, const Placed& placed,
               const Result<CalibrationResult>& plain, PreparedBatch& prepared,
               Diagnosis& diagnosis) {
  const std::vector<std::string> sources = sources_of(*cell, placed);
  std::optional<Agreement> agreement = agreement_of(cell, sources, prepared.train, plain);
  if (!agreement) return false;
  Result<CalibrationResult> found = calibrate(cell, sources, agreement->agreeing, {});
  if (!found || (plain && are_off_alike(*found, agreement->others))) return false;
  add_suspects(agreement->others, *found);
  const auto& agreeing = agreement->agreeing.measurements;
  for (const SuspectPose& one : found->suspects) {
    if (std::any_of(agreeing.begin(), agreeing.end(),
                    [&](const Measurement& m) { return m.row == one.row; }))
      continue;
    diagnosis.suspects.push_back({.pose_id = one.pose_id,
                                  .row = one.row,
                                  .distance = one.distance,
                                  .reason = "fits none of the arms on which the other rows agree"});
  }
  if (auto rows = rows_that_do_not_fit(found->suspects, static_cast<int>(agreeing.size())))
    diagnosis.notes.push_back(*std::move(rows));
  prepared.train = std::move(agreement->agreeing);
  return true;
}

/// Reports the changes on the arm between sessions, and whether they rest on an unknown order.
void tell_sessions(const Placed& placed, Diagnosis& diagnosis) {
  const CalibrationResult& by = placed.calibration;
  diagnosis.between_sessions = session_changes(
      {by.model, by.parameters, by.covariance, by.sessions, placed.changes, placed.as_given});
  if (auto order = note_on_order(by.sessions, placed.as_given))
    diagnosis.limits.push_back(std::move(*order));
}

/// The changes that are not findings, because the search has no cause for them or did not name
/// them.
std::string told_of_sessions(const Diagnosis& diagnosis) {
  std::string text;
  for (const SessionChange& change : diagnosis.between_sessions) {
    const bool is_found = change.course == SessionChange::Course::kSince &&
                          std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                                      [&](const Finding& finding) {
                                        return finding.since_session == change.session_id;
                                      });
    if (!is_found) text += "; " + sentence(change);
  }
  return text;
}

/// The sentence about a jump in the middle of the batch, if no known cause explains it. Such a jump
/// is too large for the search, which judges effects against the remaining residual.
std::string told_of_jump(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                         const Diagnosis& diagnosis) {
  if (diagnosis.verdict != Verdict::kUnknown) return "";
  const auto jump = jump_within(cell, batch.in_order_of_time(cell->robot).rows());
  if (!jump) return "";
  return fmt::format(
      " But something changed in the middle of the batch, {}: give the poses before and after it "
      "by themselves.",
      in_words(*jump));
}

/// Records the files and the seed of the diagnosis.
void tell_provenance(const Cell& cell, const CheckedBatch& batch, std::uint64_t seed,
                     Diagnosis& diagnosis) {
  diagnosis.batch_hash = batch.hash();
  diagnosis.cell_hash = sha256_hex(cell.cell_yaml + cell.robot_yaml);
  diagnosis.seed = seed;
}

/// `sources`, and all causes found beside them, with or without a certain name. Without them, a
/// link length would absorb their effects.
std::vector<std::string> with_all_found(std::vector<std::string> sources,
                                        const SearchResult& found) {
  for (const Accepted& one : found.accepted) {
    const auto is_form = [&](const std::string& own) {
      return are_forms_of_one(own, one.in_model);
    };
    if (!one.is_outlier() && std::none_of(sources.begin(), sources.end(), is_form))
      sources.push_back(one.in_model);
  }
  return sources;
}

/// Reports the origin of the drawing's error, by the cell's sources, the findings, and the geometry
/// in any case.
void tell_budget(const std::shared_ptr<const Cell>& cell, const SearchResult& searched,
                 const MeasurementBatch& batch, Diagnosis& diagnosis) {
  std::vector<std::string> sources = with_all_found(with_unknown_frames(*cell), searched);
  const std::string geometry(cause_correcting(causes::Part::kLinks).spelling);
  if (std::find(sources.begin(), sources.end(), geometry) == sources.end())
    sources.push_back(geometry);
  const Result<CalibrationResult> found =
      calibrate(cell, sources, batch, {.held = {}, .weigh_links = true});
  if (!found || !tells_a_budget(batch)) return;
  Since since;
  for (const Accepted& one : searched.accepted)
    for (const Finding& finding : diagnosis.findings)
      if (!one.is_outlier() && finding.cause == one.cause && !finding.since_session.empty())
        since[one.in_model] = finding.since_session;
  diagnosis.budget = error_budget(*found, batch, since);
}

/// The findings of a batch, with the inputs for the rest of its diagnosis.
struct Answered {
  Placed together;
  PreparedBatch prepared;
  std::unique_ptr<const Explained> explained;
  Diagnosis diagnosis;  ///< up to findings and verdict
};

/// The answer of a search that ended.
void tell_answer(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                 const DiagnoseOptions& options, SearchResult found, Answered& all) {
  Diagnosis& diagnosis = all.diagnosis;
  all.explained = std::make_unique<const Explained>(*cell, std::move(found));
  const Explained& explained = *all.explained;
  const PreparedBatch& prepared = all.prepared;

  diagnosis.batch = as_recorded(prepared.surrogates, explained.found.batch);
  tell_provenance(*cell, batch, options.seed, diagnosis);
  tell_errors(explained, prepared, diagnosis);
  tell_held_out(explained, prepared, diagnosis);
  tell_findings(explained, prepared, diagnosis.batch, remainder_of(explained, prepared, diagnosis),
                diagnosis);
  doubt_beside_parallel_axes(cell->robot, diagnosis);
  tell_since(batch.rows(), diagnosis);
  tell_noise(explained, prepared, diagnosis);
  tell_verdict(diagnosis);
  tell_row_mistakes(explained, prepared.sorted ? batch.rows() : MeasurementBatch(), diagnosis);
  tell_sources(explained.found, prepared.sorted, diagnosis);
  tell_largest_first(diagnosis);
}

/// True if bad rows may hide what the search did not name. A change in the middle of the batch
/// leaves two arms, and neither of them is bad.
bool may_hide(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
              const Answered& all) {
  return (all.explained->found.too_many_outliers || all.diagnosis.verdict == Verdict::kUnknown) &&
         !jump_within(cell, batch.in_order_of_time(cell->robot).rows());
}

Result<Answered> answered(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                          const DiagnoseOptions& options) {
  Answered all;
  all.together = TRY(placed(cell, batch, options));
  all.prepared = TRY(prepare(*cell, batch, all.together.sessions()));
  Result<SearchResult> result = searched(cell, all.prepared, all.together, options, all.diagnosis);
  std::optional<Result<CalibrationResult>> plain;
  if (result) {
    tell_answer(cell, batch, options, std::move(*result), all);
    if (!may_hide(cell, batch, all)) return all;
    plain = calibrate(cell, sources_of(*cell, all.together), all.prepared.train, {});
  } else if (result.error().code == ErrorCode::kRefused) {
    plain = Result<CalibrationResult>(tl::make_unexpected(result.error()));
  }
  Answered anew{all.together, all.prepared, nullptr, {}};
  if (!plain || !set_aside(cell, anew.together, *plain, anew.prepared, anew.diagnosis)) {
    if (!result) return tl::make_unexpected(result.error());
    return all;
  }
  Result<SearchResult> among_others =
      searched(cell, anew.prepared, anew.together, options, anew.diagnosis);
  if (!among_others) {
    if (!result) return tl::make_unexpected(among_others.error());
    return all;
  }
  tell_answer(cell, batch, options, std::move(*among_others), anew);
  return anew;
}

/// The sizes from which effects are named, proved in the batch's own residuals or in simulated
/// noise.
void tell_sizes(const std::shared_ptr<const Cell>& cell, const Explained& explained,
                const std::vector<FamilyPtr>& families, const PreparedBatch& prepared,
                const DiagnoseOptions& options, Diagnosis& diagnosis) {
  if (!options.prove)
    return tell_recovery(explained, families, options.seed + kRecoveryDraw, diagnosis);
  const std::vector<std::string> best = with_all_found(diagnosis.sources_after, explained.found);
  const auto answer = [](const std::shared_ptr<const Cell>& one, const CheckedBatch& rows,
                         const DiagnoseOptions& own) {
    return answered(one, rows, own).map([](Answered all) { return std::move(all.diagnosis); });
  };
  diagnosis.proof = proof_of(
      {cell, explained, families, best, prepared.surrogates, diagnosis.could_not_have_seen, answer},
      options);
}

Result<Diagnosis> diagnosed(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                            const DiagnoseOptions& options) {
  Answered all = TRY(answered(cell, batch, options));
  Diagnosis& diagnosis = all.diagnosis;
  const PreparedBatch& prepared = all.prepared;
  const Explained& explained = *all.explained;
  const SearchResult& found = explained.found;
  const std::vector<FamilyPtr> families = make_families(explained.after);

  std::vector<Step> steps;
  steps.push_back({"asking what could not have been seen", 0.72, [&] {
                     tell_blindness(explained, families, *cell, prepared.surrogates,
                                    diagnosis.batch, diagnosis);
                     tell_periodograms(explained, diagnosis);
                   }});
  steps.push_back(
      {"planning the next poses", 0.8, [&] { tell_next_poses(explained, options, diagnosis); }});
  if (options.recovery || options.prove) {
    steps.push_back({"hiding effects in the poses", 0.85,
                     [&] { tell_sizes(cell, explained, families, prepared, options, diagnosis); }});
  }
  steps.push_back({"looking at what is left", 0.95, [&] {
                     tell_left_over(explained, options.seed, diagnosis);
                     tell_limits(explained, prepared, as_recorded(prepared.surrogates, found.all),
                                 diagnosis);
                     tell_budget(cell, found, prepared.train, diagnosis);
                     tell_file_doubts(cell, with_all_found(diagnosis.sources_after, found),
                                      prepared.train, diagnosis);
                   }});
  TRY(run(steps, options));
  tell_sessions(all.together, diagnosis);
  doubt_changes(batch.rows(), diagnosis);
  diagnosis.sentence = file_doubts_said(diagnosis) + sentence_for(diagnosis) +
                       told_of_sessions(diagnosis) + told_of_jump(cell, batch, diagnosis);
  return std::move(diagnosis);
}

}  // namespace

}  // namespace trammel::cause_search

namespace trammel {

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                           const DiagnoseOptions& options) {
  return cause_search::diagnosed(cell, batch, options);
}

}  // namespace trammel
