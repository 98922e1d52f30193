#include "server/diagnose/diagnose.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/calibrate/frames.h"
#include "server/diagnose/dependence.h"
#include "server/diagnose/effect.h"
#include "server/diagnose/findings.h"
#include "server/diagnose/folds.h"
#include "server/diagnose/naming.h"
#include "server/diagnose/next_poses.h"
#include "server/diagnose/recovery.h"
#include "server/diagnose/search.h"
#include "server/diagnose/separability.h"
#include "server/diagnose/surrogates.h"
#include "server/diagnose/validation.h"
#include "server/diagnose/wording.h"
#include "server/measurement/repeats.h"
#include "server/measurement/velocity.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPeriodogramLine = 0.01;
constexpr std::size_t kRecoveries = 3;
constexpr int kFewestPoses = 12;

Error given_up() { return {ErrorCode::kBusy, "diagnosis given up on request"}; }

bool reported(const DiagnoseOptions& options, const std::string& stage, double share) {
  return !options.progress || options.progress(stage, share);
}

std::vector<std::string> limits_of(const MeasurementBatch& batch, const RepeatStatistics& repeats) {
  const auto none = [&](const std::function<bool(const Measurement&)>& has) {
    return std::none_of(batch.measurements.begin(), batch.measurements.end(), has);
  };
  std::vector<std::string> limits;
  if (none([](const Measurement& m) { return m.R_WT.has_value(); }))
    limits.emplace_back("no orientations: several geometry parameters and all of the tool's rotation stay unseen");
  if (none([](const Measurement& m) { return m.context.time.has_value(); }))
    limits.emplace_back("no times: a drift, and what warms up, can only be told by the order of the poses");
  if (none([](const Measurement& m) { return m.context.temperature.has_value(); }))
    limits.emplace_back(
        "no temperatures: thermal growth was looked for by the order of the poses, and cannot be told from a drift");
  if (none([](const Measurement& m) { return !m.context.direction.empty(); }))
    limits.emplace_back(
        "no approach directions: backlash was looked for as if each joint came from where it was at the row before, "
        "and cannot be named for certain");
  if (repeats.degrees_of_freedom == 0)
    limits.emplace_back("no repeated poses: the noise is taken from the tracker and from what is left");
  return limits;
}

void fill_unexplained(Diagnosis& diagnosis, const SearchResult& found, const LinearProblem& problem,
                      const Background& all) {
  if (found.unnamed.empty()) return;
  const Unnamed& strongest = *std::max_element(found.unnamed.begin(), found.unnamed.end(),
                                               [](const Unnamed& a, const Unnamed& b) { return a.score < b.score; });
  diagnosis.unexplained = {true, {}, 0, strongest.p_value};
  for (const Unnamed& one : found.unnamed) {
    for (const std::string& on : one.depends_on) {
      auto& list = diagnosis.unexplained.depends_on;
      if (std::find(list.begin(), list.end(), on) == list.end()) list.push_back(on);
    }
  }
  const Index P = problem.nuisance().cols();
  const VectorXd numbers = all.estimate(problem.residual());
  const Index count = numbers.size() - P;
  // Of it, what the model's own parameters cannot do.
  const VectorXd function = all.columns().rightCols(count) * numbers.tail(count);
  diagnosis.unexplained.rms = problem.position_rms(Background(problem.nuisance()).project(function));
}

Verdict verdict_of(const Diagnosis& diagnosis) {
  if (diagnosis.findings.empty()) return diagnosis.unexplained.present ? Verdict::kUnknown : Verdict::kNothing;
  const bool doubt = std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                                 [](const Finding& finding) { return !finding.could_also_be.empty(); });
  return doubt ? Verdict::kAmbiguous : Verdict::kNamed;
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

/// What is left after the nominal chain, the cell's own sources and each finding in turn; at last the noise.
std::vector<WaterfallStep> waterfall_of(const SearchResult& found, const LinearProblem& before,
                                        const LinearProblem& after, double noise) {
  std::vector<WaterfallStep> steps;
  Eigen::Matrix3Xd nominal(3, before.poses());
  for (Index i = 0; i < before.poses(); ++i) {
    const Measurement& m = before.batch().measurements[static_cast<std::size_t>(i)];
    nominal.col(i) = m.p_W - found.before.model.nominal_pose_W(m.context).translation();
  }
  steps.push_back({"nominal", figures_of(nominal).rms});
  steps.push_back({"calibrated", before.position_rms(before.residual())});
  // Each finding in turn, everything else refitted: the later ones' effects are put back into what is left.
  VectorXd data = after.residual();
  std::vector<Index> chosen(static_cast<std::size_t>(after.nuisance().cols()));
  std::iota(chosen.begin(), chosen.end(), Index{0});
  std::vector<WaterfallStep> tail;
  for (auto finding = found.accepted.rbegin(); finding != found.accepted.rend(); ++finding) {
    if (finding->source.empty()) continue;
    const Background fitted(after.nuisance()(Eigen::all, chosen));
    tail.push_back({to_string(finding->cause), after.position_rms(data - fitted.columns() * fitted.estimate(data))});
    data += effect_of_source(after, finding->in_model);
    const std::vector<Index> own = places_of_source(after.model(), finding->in_model);
    std::erase_if(chosen, [&](Index k) { return std::find(own.begin(), own.end(), k) != own.end(); });
  }
  steps.insert(steps.end(), tail.rbegin(), tail.rend());
  steps.push_back({"noise of one measurement", std::sqrt(3.0) * noise});
  return steps;
}

}  // namespace

Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                           const DiagnoseOptions& options) {
  Result<MeasurementBatch> checked = check_against_cell(batch, *cell);
  if (!checked) return tl::make_unexpected(checked.error());
  const bool sorted = put_in_order_of_time(*checked);
  fill_velocity(*checked);
  BatchSplit split = split_batch(*checked, 0, options.seed);
  MergedRepeats merged = merge_repeats(split.train, cell->tracker.sigma);
  const Surrogates surrogates = put_in_surrogates(*checked);
  take_over_surrogates(surrogates, *checked, merged.batch);
  take_over_surrogates(surrogates, *checked, split.validation);
  if (merged.batch.measurements.size() < static_cast<std::size_t>(kFewestPoses)) {
    return refused("batch {}: {} poses to diagnose, at least {}", batch.id, merged.batch.measurements.size(),
                   kFewestPoses);
  }
  if (!reported(options, "calibrating", 0)) return tl::make_unexpected(given_up());
  Result<SearchResult> searched =
      search_causes(cell, with_unknown_tool(cell->model.error_sources, *cell), merged.batch, options);
  if (!searched) return tl::make_unexpected(searched.error());
  const SearchResult& found = *searched;
  MeasurementBatch recorded = found.batch;
  MeasurementBatch all_recorded = found.all;
  take_out_surrogates(surrogates, recorded);
  take_out_surrogates(surrogates, all_recorded);

  if (!reported(options, "measuring the gain", 0.65)) return tl::make_unexpected(given_up());
  const std::vector<std::string> candidates = candidate_sources(*cell, found.batch, nullptr);
  // Before and after are compared on the same poses: leaving one out is no gain.
  const LinearProblem before(found.before.model, found.batch, found.before.priors, candidates);
  const LinearProblem after(found.after.model, found.batch, found.after.priors, candidates);
  const Background all(background_columns(after, found.unnamed));
  // What the extended model leaves when it is fitted by itself, as a training would: nothing unnamed beside it.
  PriorModel extended = found.after;
  if (!found.unnamed.empty()) refine(extended, found.batch, {});
  const LinearProblem served(extended.model, found.batch, extended.priors, {});

  Diagnosis diagnosis;
  diagnosis.poses = static_cast<int>(found.all.measurements.size());
  diagnosis.noise = after.noise();
  diagnosis.instrument = after.instrument();
  diagnosis.noise_from =
      fmt::format("{}{:.1f} um stated for a pose, {:.1f} um beyond it",
                  merged.statistics.degrees_of_freedom > 0
                      ? fmt::format("one measurement {:.1f} um by {} poses measured repeatedly; ",
                                    1e6 * merged.statistics.sigma, merged.statistics.groups)
                      : "",
                  1e6 * after.instrument(),
                  1e6 * std::sqrt(std::max(0.0, std::pow(after.noise(), 2) - std::pow(after.instrument(), 2))));
  diagnosis.before = figures_of(before.positions(before.residual()));
  diagnosis.after = figures_of(served.positions(served.residual()));
  diagnosis.findings = findings_of(found, after);
  if (surrogates.time) {
    for (Finding& finding : diagnosis.findings) {
      for (PossibleBeginning& place : finding.may_begin_at) place.time.reset();
    }
  }
  doubt_what_was_not_recorded(surrogates, recorded, diagnosis.findings);
  fill_unexplained(diagnosis, found, after, all);
  doubt_beside(diagnosis.unexplained, diagnosis.findings);
  diagnosis.verdict = verdict_of(diagnosis);
  for (const Accepted& one : found.accepted) {
    if (one.source.empty()) diagnosis.suspects.push_back(one.pose);
  }
  for (const ErrorSourcePtr& source : found.before.model.sources) diagnosis.sources_before.push_back(source->name());
  diagnosis.sources_after = diagnosis.sources_before;
  for (const Finding& finding : diagnosis.findings) {
    // Which number of a cause it is may stay open: the cause as a whole is identified anyway. And a more general
    // description does the same to the poses.
    const bool sure = std::all_of(finding.could_also_be.begin(), finding.could_also_be.end(), [&](const Cause& other) {
      return (other.cause == finding.cause.cause && other.joint == finding.cause.joint) ||
             is_description_of(other, finding.cause);
    });
    // A list of sources says by its row where a cause begins; in a batch whose rows were moved that row is another.
    const bool at_a_row = !sorted || finding.cause.pose_id.empty();
    if (!finding.source.empty() && sure && at_a_row) diagnosis.sources_after.push_back(finding.source);
  }
  if (!found.reformed_from.empty() && diagnosis.sources_after.size() > diagnosis.sources_before.size())
    std::replace(diagnosis.sources_after.begin(), diagnosis.sources_after.end(), found.reformed_from,
                 found.reformed_to);
  if (split.validation.measurements.empty()) {
    const HeldOut held_out = held_out_of(before, served);
    diagnosis.held_out_before = held_out.before;
    diagnosis.held_out_after = held_out.after;
    diagnosis.held_out_how =
        fmt::format("{} folds, each predicted from the others; the causes were chosen on all poses",
                    Folds(after, after.nuisance()).count());
  } else {
    Validation validation = validate(before, served, split.validation);
    diagnosis.held_out_before = validation.before;
    diagnosis.held_out_after = validation.after;
    diagnosis.held_out_before_without = validation.before_without;
    diagnosis.held_out_after_without = validation.after_without;
    std::move(validation.fit_neither.begin(), validation.fit_neither.end(), std::back_inserter(diagnosis.suspects));
    diagnosis.held_out_how = fmt::format("{} validation rows", split.validation.measurements.size());
  }

  if (!reported(options, "asking what could not have been seen", 0.72)) return tl::make_unexpected(given_up());
  const std::vector<FamilyPtr> families = make_families(after);
  Blindness blind = blindness(after, families, all, found.chance);
  diagnosis.could_not_have_seen = std::move(blind.unseen);
  std::erase_if(diagnosis.could_not_have_seen,
                [&](const Unseen& unseen) { return is_by_surrogate(surrogates, unseen.cause); });
  static_cast<void>(candidate_sources(*cell, recorded, &diagnosis.could_not_have_seen));
  diagnosis.not_separable = std::move(blind.inseparable);
  for (Inseparable& pair : hidden_by_constancy(found.before.model, recorded))
    diagnosis.not_separable.push_back(std::move(pair));

  const Background first(before.nuisance());
  for (int joint = 0; joint < cell->robot.size(); ++joint) {
    if (cell->robot.joint(joint).type != JointType::kRevolute || !make_gear_family(before, joint)) continue;
    Periodogram lines = periodogram(before, joint, first);
    const double chance = found.chance.penalty_of(*make_gear_family(before, joint));
    lines.limit = strength_for(found.chance.limit_at(kPeriodogramLine) + chance, 2);
    diagnosis.periodograms.push_back(std::move(lines));
  }
  diagnosis.waterfall = waterfall_of(found, before, served, after.noise());

  if (!reported(options, "planning the next poses", 0.8)) return tl::make_unexpected(given_up());
  diagnosis.next_poses = next_poses_for(found, before, options);
  if (diagnosis.next_poses.q.empty()) diagnosis.next_poses.none_because = why_no_next_poses(diagnosis.findings);
  if (options.recovery) {
    if (!reported(options, "hiding effects in the poses", 0.85)) return tl::make_unexpected(given_up());
    std::vector<std::size_t> places;
    const auto add = [&](const std::string& cause, int joint) {
      for (std::size_t f = 0; f < families.size() && places.size() < kRecoveries; ++f) {
        const Cause one = families[f]->cause(families[f]->typical());
        if (families[f]->named() && one.cause == cause && (joint < 0 || one.joint == joint)) {
          if (std::find(places.begin(), places.end(), f) == places.end()) places.push_back(f);
          break;
        }
      }
    };
    for (const Finding& finding : diagnosis.findings) add(finding.cause.cause, finding.cause.joint);
    add("gear_transmission", -1);
    add("encoder_eccentricity", 1);
    add("tracker_moved", -1);
    diagnosis.recovery = recovery_of(after, families, all, found.chance, places, options.seed + 2);
  }
  if (!reported(options, "looking at what is left", 0.95)) return tl::make_unexpected(given_up());
  diagnosis.leftover = dependence_of(after, all.project(after.residual()), options.seed);
  diagnosis.limits = limits_of(all_recorded, merged.statistics);
  if (sorted)
    diagnosis.limits.emplace_back(
        "the rows are not in the order of their times: they were put into it, and what begins at a pose is not "
        "applied");
  if (found.too_many_outliers)
    diagnosis.limits.emplace_back("more than a tenth of the poses fit neither the model nor each other: measure again");

  const Matrix3 R_BW = found.before.model.X_WB.linear().transpose();
  diagnosis.batch = std::move(recorded);
  diagnosis.residual_after_B = R_BW * served.positions(served.residual());
  diagnosis.residual_before_B = R_BW * before.positions(before.residual());
  diagnosis.batch_hash = batch_hash(batch);
  diagnosis.cell_hash = sha256_hex(cell->cell_yaml + cell->robot_yaml);
  diagnosis.seed = options.seed;
  diagnosis.sentence = sentence_for(diagnosis);
  return diagnosis;
}

}  // namespace trammel
