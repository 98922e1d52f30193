#include "server/diagnose/tell/answers.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/diagnose/evidence/dependence.h"
#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/evidence/validation.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/search/naming.h"
#include "server/diagnose/search/recovery.h"
#include "server/diagnose/tell/doubts.h"
#include "server/diagnose/tell/findings.h"
#include "server/diagnose/tell/next_poses.h"
#include "server/diagnose/tell/separability.h"
#include "server/diagnose/tell/slow_change.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"
#include "server/measurement/one_place.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPeriodogramLine =
    0.01;  // share of batches in which chance exceeds the threshold of a periodogram
constexpr std::size_t kRecoveries = 3;  // curves on the page

LinearProblem problem_of(const Cell& cell, const PriorModel& model, const MeasurementBatch& batch) {
  return {model.model, batch, model.priors, candidate_sources(cell, batch, nullptr)};
}

LinearProblem by_itself(const SearchResult& found) {
  PriorModel extended = found.after;
  if (!found.unnamed.empty()) refine(extended, found.batch, {});
  return {extended.model, found.batch, extended.priors, {}};
}

bool is_play(const Cause& cause) { return record_of(cause).search == causes::SearchFamily::kPlay; }

/// Causes whose sizes are shown as examples, the most telling first.
std::vector<const CauseRecord*> examples() {
  std::vector<const CauseRecord*> all = all_causes();
  std::erase_if(all, [](const CauseRecord* record) { return !record->example; });
  std::stable_sort(all.begin(), all.end(), [](const CauseRecord* a, const CauseRecord* b) {
    return a->example->rank < b->example->rank;
  });
  return all;
}

Unexplained unexplained_of(const SearchResult& found, const LinearProblem& problem,
                           const Background& all, const Surrogates& unrecorded) {
  if (found.unnamed.empty()) return {};
  const Unnamed& strongest =
      *std::max_element(found.unnamed.begin(), found.unnamed.end(),
                        [](const Unnamed& a, const Unnamed& b) { return a.score < b.score; });
  Unexplained unexplained{true, {}, 0, strongest.p_value, {}};
  for (const Unnamed& one : found.unnamed) {
    for (const std::string& on : one.depends_on) {
      auto& list = unexplained.depends_on;
      if (std::find(list.begin(), list.end(), on) == list.end()) list.push_back(on);
    }
  }
  if (!found.negative_play.empty()) {
    const bool every = std::none_of(found.accepted.begin(), found.accepted.end(),
                                    [](const Accepted& one) { return is_play(one.cause); });
    unexplained.hint = what_negative_play_may_be(found.negative_play, every);
  }
  for (const WrongSign& one : found.wrong_signs)
    unexplained.hint += (unexplained.hint.empty() ? "" : "; ") + what_wrong_sign_means(one);
  const auto& on = unexplained.depends_on;
  if (std::find(on.begin(), on.end(), kAttitude) != on.end())
    unexplained.hint +=
        std::string(unexplained.hint.empty() ? "" : "; ") +
        "the tool moves by how it stands to gravity: see whether it sags in its clamp or mount";
  const std::string slow = what_moves(found, problem, all, unrecorded);
  unexplained.hint += (unexplained.hint.empty() || slow.empty() ? "" : ". ") + slow;
  const Index P = problem.nuisance().cols();
  const VectorXd numbers = all.estimate(problem.residual());
  const Index count = numbers.size() - P;
  // Only the part that the model's own parameters cannot have counts.
  const VectorXd function = all.columns().rightCols(count) * numbers.tail(count);
  unexplained.rms = problem.position_rms(Background(problem.nuisance()).project(function));
  return unexplained;
}

/// The error that is left after the nominal chain, the cell's own sources and each finding in turn;
/// the last step is the unexplained rest.
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
  // Adds each finding in turn with everything else refitted: the effects of the later ones return
  // to the residual.
  VectorXd data = after.residual();
  std::vector<Index> chosen(static_cast<std::size_t>(after.nuisance().cols()));
  std::iota(chosen.begin(), chosen.end(), Index{0});
  const Background all(after.nuisance());
  std::vector<WaterfallStep> tail;
  for (auto finding = found.accepted.rbegin(); finding != found.accepted.rend(); ++finding) {
    if (finding->is_outlier()) continue;
    const Background fitted = all.part(chosen);
    tail.push_back({to_string(finding->cause),
                    after.position_rms(data - fitted.columns() * fitted.estimate(data))});
    data += effect_of_source(after, finding->in_model);
    const std::vector<Index> own = places_of_source(after.model(), finding->in_model);
    std::erase_if(chosen,
                  [&](Index k) { return std::find(own.begin(), own.end(), k) != own.end(); });
  }
  steps.insert(steps.end(), tail.rbegin(), tail.rend());
  steps.push_back({noise_name(noise, after.instrument()), std::sqrt(3.0) * noise});
  return steps;
}

/// A finding that is only the best known shape of an effect still has that effect on the poses.
bool is_sure(const Finding& finding) {
  return !finding.whole || differ_in_form_only(finding.cause, finding.could_also_be);
}

bool is_outlier(const Finding& finding) { return finding.source.empty(); }

/// True if the finding is an outlier, or may be part of a larger unknown effect.
bool is_less_than_what_is_left(const Finding& finding, const Unexplained& left) {
  const auto& rivals = finding.could_also_be;
  return is_outlier(finding) || (finding.effect_rms < left.rms &&
                                 std::any_of(rivals.begin(), rivals.end(), [](const Cause& rival) {
                                   return rival.cause == unknown_cause().cause;
                                 }));
}

}  // namespace

Explained::Explained(const Cell& cell, SearchResult search)
    : found(std::move(search)),
      before(problem_of(cell, found.before, found.batch)),
      after(problem_of(cell, found.after, found.batch)),
      all(background_columns(after, found.unnamed)),
      served(by_itself(found)) {}

void tell_errors(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis) {
  const LinearProblem& after = explained.after;
  diagnosis.poses = static_cast<int>(explained.found.all.measurements.size());
  diagnosis.noise = after.noise();
  diagnosis.instrument = after.instrument();
  diagnosis.noise_from = fmt::format(
      "{}the tracker's stated sigma alone gives {:.1f} um",
      prepared.repeats.degrees_of_freedom > 0
          ? fmt::format("{} poses measured repeatedly scatter by {:.1f} um; ",
                        prepared.repeats.groups, 1e6 * std::sqrt(3.0) * prepared.repeats.sigma)
          : "",
      1e6 * std::sqrt(3.0) * after.instrument() / prepared.vouched);
  const LinearProblem& before = explained.before;
  const LinearProblem& served = explained.served;
  diagnosis.before = figures_of(before.positions(before.residual()));
  diagnosis.after = figures_of(served.positions(served.residual()));
  diagnosis.waterfall = waterfall_of(explained.found, before, served, after.noise());
  const Matrix3 R_BW = explained.found.before.model.X_WB.linear().transpose();
  diagnosis.residual_after_B = R_BW * served.positions(served.residual());
  diagnosis.residual_before_B = R_BW * before.positions(before.residual());
}

void tell_findings(const Explained& explained, const PreparedBatch& prepared,
                   const MeasurementBatch& recorded, const Remainder& remainder,
                   Diagnosis& diagnosis) {
  const SearchResult& found = explained.found;
  diagnosis.unexplained =
      unexplained_of(found, explained.after, explained.all, prepared.surrogates);
  const double left = std::max(remainder.rms, diagnosis.unexplained.rms);
  diagnosis.findings =
      findings_of(found, explained.after, diagnosis.unexplained, prepared.surrogates, recorded,
                  {remainder.more_than_noise, left, remainder.larger});
  std::vector<SuspectedPose> out;
  for (const Accepted& one : found.accepted) {
    if (!one.is_outlier()) continue;
    out.push_back(one.pose);
    const bool is_in_doubt = std::any_of(
        diagnosis.findings.begin(), diagnosis.findings.end(), [&](const Finding& finding) {
          return finding.cause.pose_id == one.cause.pose_id && finding.source.empty() &&
                 !finding.could_also_be.empty();
        });
    if (is_in_doubt)
      out.back().reason =
          "what the simulation lacks may be largest there: repeat it and its neighbours";
  }
  diagnosis.suspects.insert(diagnosis.suspects.begin(), out.begin(), out.end());
}

void tell_verdict(Diagnosis& diagnosis) {
  const std::vector<Finding>& findings = diagnosis.findings;
  const bool left = diagnosis.unexplained.present;
  const auto is_less = [&](const Finding& finding) {
    return is_less_than_what_is_left(finding, diagnosis.unexplained);
  };
  if (findings.empty() || (left && std::all_of(findings.begin(), findings.end(), is_less))) {
    diagnosis.verdict = left ? Verdict::kUnknown : Verdict::kNothing;
    return;
  }
  const bool doubt = std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
    return !finding.could_also_be.empty();
  });
  diagnosis.verdict = doubt ? Verdict::kAmbiguous : Verdict::kNamed;
}

void tell_largest_first(Diagnosis& diagnosis) {
  std::stable_sort(
      diagnosis.findings.begin(), diagnosis.findings.end(), [](const Finding& a, const Finding& b) {
        return std::pair(is_outlier(a), -a.effect_rms) < std::pair(is_outlier(b), -b.effect_rms);
      });
}

void tell_sources(const SearchResult& found, bool sorted, Diagnosis& diagnosis) {
  for (const ErrorSourcePtr& source : found.before.model.sources)
    diagnosis.sources_before.push_back(source->name());
  diagnosis.sources_after = diagnosis.sources_before;
  for (const Finding& finding : diagnosis.findings) {
    // A list of sources gives the first row of a cause; in a batch with moved rows that row is
    // another one.
    const bool at_a_row = !sorted || finding.cause.pose_id.empty();
    if (!finding.source.empty() && is_sure(finding) && at_a_row)
      diagnosis.sources_after.push_back(finding.source);
  }
  if (diagnosis.sources_after.size() > diagnosis.sources_before.size()) {
    for (const Reformed& one : found.reformed)
      std::replace(diagnosis.sources_after.begin(), diagnosis.sources_after.end(), one.from,
                   one.to);
  }
}

void tell_held_out(const Explained& explained, const PreparedBatch& prepared,
                   Diagnosis& diagnosis) {
  if (prepared.validation.measurements.empty()) {
    const HeldOut held_out = held_out_of(explained.before, explained.served);
    diagnosis.held_out_before = held_out.before;
    diagnosis.held_out_after = held_out.after;
    diagnosis.held_out_how =
        fmt::format("{} folds, each predicted from the others; the causes were chosen on all poses",
                    Folds(explained.after, explained.after.nuisance()).count());
    return;
  }
  Validation validation = validate(explained.before, explained.served, prepared.validation);
  diagnosis.held_out_before = validation.before;
  diagnosis.held_out_after = validation.after;
  diagnosis.held_out_before_without = validation.before_without;
  diagnosis.held_out_after_without = validation.after_without;
  std::move(validation.fit_neither.begin(), validation.fit_neither.end(),
            std::back_inserter(diagnosis.suspects));
  diagnosis.held_out_how =
      fmt::format("{} validation rows", prepared.validation.measurements.size());
}

void tell_blindness(const Explained& explained, const std::vector<FamilyPtr>& families,
                    const Cell& cell, const Surrogates& surrogates,
                    const MeasurementBatch& recorded, Diagnosis& diagnosis) {
  Blindness blind = blindness(explained.after, families, explained.all, explained.found.chance);
  diagnosis.could_not_have_seen = std::move(blind.unseen);
  std::erase_if(diagnosis.could_not_have_seen,
                [&](const Unseen& unseen) { return is_by_surrogate(surrogates, unseen.cause); });
  std::erase_if(diagnosis.could_not_have_seen,
                [&](const Unseen& unseen) {  // seen, with a sign that has no name
                  const std::vector<PlaySign>& seen = explained.found.negative_play;
                  return is_play(unseen.cause) &&
                         std::any_of(seen.begin(), seen.end(), [&](const PlaySign& one) {
                           return one.joint == unseen.cause.joint;
                         });
                });
  static_cast<void>(candidate_sources(cell, recorded, &diagnosis.could_not_have_seen));
  diagnosis.not_separable = std::move(blind.inseparable);
  for (Inseparable& pair : hidden_by_constancy(explained.found.before.model, recorded))
    diagnosis.not_separable.push_back(std::move(pair));
}

void tell_periodograms(const Explained& explained, Diagnosis& diagnosis) {
  const LinearProblem& before = explained.before;
  const Chance& chance = explained.found.chance;
  const CauseRecord& gear = first_searched_by(causes::SearchFamily::kOrder);
  const Background first(before.nuisance());
  const auto& robot = before.model().cell->robot;
  for (int joint = 0; joint < robot.size(); ++joint) {
    if (robot.joint(joint).type != JointType::kRevolute) continue;
    const FamilyPtr orders = make_order_family(before, cause_at(gear, joint));
    if (!orders) continue;
    Periodogram lines = periodogram(before, joint, first);
    lines.limit = strength_for(chance.limit_at(kPeriodogramLine) + chance.penalty_of(*orders), 2);
    diagnosis.periodograms.push_back(std::move(lines));
  }
}

void tell_next_poses(const Explained& explained, const DiagnoseOptions& options,
                     Diagnosis& diagnosis) {
  diagnosis.next_poses = next_poses_for(explained.found, explained.before, options);
  if (diagnosis.next_poses.q.empty())
    diagnosis.next_poses.none_because = why_no_next_poses(diagnosis.findings);
}

void tell_left_over(const Explained& explained, std::uint64_t seed, Diagnosis& diagnosis) {
  const VectorXd left = explained.all.project(explained.after.residual());
  diagnosis.leftover = dependence_of(explained.after, explained.all, left, seed);
  Unexplained& unexplained = diagnosis.unexplained;
  if (!unexplained.present || !unexplained.depends_on.empty()) return;
  for (const Dependence& one : diagnosis.leftover) {  // the surest first
    if (one.p_value > thresholds::kChangesWith) break;
    if (unexplained.depends_on.empty()) unexplained.p_value = one.p_value;
    auto& on = unexplained.depends_on;
    if (std::find(on.begin(), on.end(), one.on) == on.end()) on.push_back(one.on);
  }
}

void tell_recovery(const Explained& explained, const std::vector<FamilyPtr>& families,
                   std::uint64_t seed, Diagnosis& diagnosis) {
  std::vector<std::size_t> places;
  const auto add = [&](std::string_view cause, int joint) {
    for (std::size_t f = 0; f < families.size() && places.size() < kRecoveries; ++f) {
      const Cause one = families[f]->cause(families[f]->typical());
      if (!families[f]->named() || one.cause != cause || (joint >= 0 && one.joint != joint))
        continue;
      if (std::find(places.begin(), places.end(), f) == places.end()) places.push_back(f);
      break;
    }
  };
  for (const Finding& finding : diagnosis.findings) add(finding.cause.cause, finding.cause.joint);
  for (const CauseRecord* example : examples()) add(example->spelling, example->example->joint);
  diagnosis.recovery =
      recovery_of(explained.after, families, explained.all, explained.found.chance, places, seed);
}

void tell_limits(const Explained& explained, const PreparedBatch& prepared,
                 const MeasurementBatch& recorded, Diagnosis& diagnosis) {
  std::vector<std::string>& limits = diagnosis.limits;
  const auto recorded_of = [&](bool (*has)(const Measurement&), std::string_view what,
                               std::string_view of_none, std::string_view of_some) {
    const auto count =
        std::count_if(recorded.measurements.begin(), recorded.measurements.end(), has);
    const auto all = static_cast<std::ptrdiff_t>(recorded.measurements.size());
    if (count == 0) limits.push_back(fmt::format("no {}: {}", what, of_none));
    if (count > 0 && count < all)
      limits.push_back(fmt::format("{} of {} of {} poses only: {}", what, count, all, of_some));
  };
  recorded_of([](const Measurement& m) { return m.R_WT.has_value(); }, "orientations",
              "several geometry parameters and all of the tool's rotation stay unseen",
              "the others count with their positions");
  recorded_of([](const Measurement& m) { return m.context.time.has_value(); }, "times",
              "a drift, and what warms up, can only be told by the order of the poses",
              "no drift was looked for");
  recorded_of(
      [](const Measurement& m) { return m.context.temperature.has_value(); }, "temperatures",
      "thermal growth was looked for by the order of the poses, and cannot be told from a drift",
      "thermal growth was not looked for");
  recorded_of([](const Measurement& m) { return !m.context.direction.empty(); },
              "approach directions",
              "backlash was looked for as if each joint came from where it was at the row before, "
              "and cannot be named for certain",
              "backlash was not looked for");
  if (prepared.repeats.degrees_of_freedom == 0)
    limits.emplace_back(
        "no repeated poses: the noise is taken from the tracker and from what is left");
  if (prepared.sorted)
    limits.emplace_back(
        "the rows are not in the order of their times: they were put into it, and what begins at a "
        "pose is not applied");
  if (is_each_tool_at_one_place(recorded))
    limits.emplace_back(
        "every tool was measured at one point: base, tool and the zeros of the last three joints "
        "cannot be told apart there; measure poses all over the workspace");
  if (explained.found.too_many_outliers)
    limits.emplace_back(
        "more than a tenth of the poses fit neither the model nor each other: measure again");
}

}  // namespace trammel::cause_search
