// Batch triage. The model: a measured pose (six numbers, or three for a position alone) differs
// from the prediction of the model in force by
//
//   r_i = J_i delta + A_i theta + e_i,    delta ~ N(0, C),    e_i ~ N(0, S_i),
//
// Here delta is the error that calibration left in the model's own parameters (C is its posterior
// covariance). S_i is the variance that the model expects of this very pose (measurement, learned
// bias, discrepancy; at least that of its own held-out poses, for positions and for orientations).
// theta has the parameters that one alternative frees: six numbers of the base, six of the tool,
// four of the payload, one zero of a joint, or all parameters of the arm. Every alternative is
// fitted in full (the sources' exact derivatives, Gauss-Newton) and scored by
//
//   sum_i min(|S_i^-1/2 r_i|^2, c_i) + delta' C^-1 delta + k log m,    c_i = m_i log m + 2 log n,
//
// where m_i is the count of numbers of pose i, and m that of all. The score is minus twice the log
// likelihood with Schwarz's price for the k directions of theta that the poses show. A pose that
// costs more than c_i is cheaper with m_i free numbers of its own: it is a single bad pose, chosen
// among n.
//
// An alternative *explains* the batch by the chi^2 of its inliers, not by its rank among
// alternatives. Among those that explain it the lowest score wins, and every other within kDoubt of
// it counts as possible as well. Simple alternatives come first: one cause; then one cause while
// the tracker stands elsewhere, as after every set-up; then one cause that begins in the middle of
// the batch.
//
// Limits of what is identifiable: a turned base equals a slipped joint 1 (both turn about its
// axis), and a shifted tool equals the last link. The payload shows through compliance only, so it
// is no alternative for a model without compliance. A tool that is turned about its own point shows
// in the orientations alone; a model that never saw an orientation cannot judge it.
#include "server/diagnose/triage.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/batch_check.h"
#include "server/compensate/known_rows.h"
#include "server/compensate/world.h"
#include "server/diagnose/triage/batch_alternatives.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

using batch_triage::Alternative;
using batch_triage::Alternatives;
using batch_triage::Comparison;
using batch_triage::Fit;
using batch_triage::kFewOutliers;

constexpr std::size_t kFewestPoses = 8;
constexpr double kDoubt = 10;  // of scores: odds of e^5
constexpr int kStepGrid = 12;  // places of a batch at which something may have begun, then refined

/// The alternatives that have been tried, the best first.
struct Tried {
  Alternative alternative;
  Fit fit;
};

class Judge {
 public:
  Judge(const Comparison& comparison, const Alternatives& alternatives)
      : comparison_(comparison), alternatives_(alternatives) {}

  Triage verdict() {
    const Tried none{alternatives_.none(), comparison_.fit(alternatives_.none())};
    const bool as_expected = none.fit.explains;
    if (!(as_expected && none.fit.outliers.size() <= static_cast<std::size_t>(kFewOutliers))) {
      if (as_expected) tried_.push_back(none);
      try_all(alternatives_.from(0, ""));
      if (tried_.empty()) try_all(alternatives_.with_the_tracker());
      if (tried_.empty() || !tried_.front().fit.outliers.empty()) try_steps();
    } else {
      tried_.push_back(none);
    }
    return told(none);
  }

 private:
  void keep(Tried one) {
    if (!one.fit.explains) return;
    tried_.push_back(std::move(one));
    std::stable_sort(tried_.begin(), tried_.end(),
                     [](const Tried& a, const Tried& b) { return a.fit.score < b.fit.score; });
  }
  void try_all(std::vector<Alternative> alternatives) {
    for (Alternative& one : alternatives) {
      Fit fit = comparison_.fit(one);
      keep({std::move(one), std::move(fit)});
    }
  }
  /// Tries causes that begin at a pose: first on a grid, then near the best place.
  void try_steps() {
    const int n = comparison_.poses();
    const std::size_t kinds = alternatives_.from(1, "").size();
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      const auto at = [&](int first) {
        return std::move(alternatives_.from(first, pose_id(first))[kind]);
      };
      const auto score = [&](int first) { return comparison_.fit(at(first)).score; };
      int best = 0;
      double least = 0;
      for (int k = 1; k < kStepGrid; ++k) {
        const int first = k * n / kStepGrid;
        if (first < 1) continue;
        const double here = score(first);
        if (best == 0 || here < least) best = first, least = here;
      }
      for (int width = n / kStepGrid; best > 0 && width > 0; width /= 2) {
        for (const int first : {best - width, best + width}) {
          if (first < 1 || first >= n) continue;
          const double here = score(first);
          if (here < least) best = first, least = here;
        }
      }
      if (best > 0) keep({at(best), comparison_.fit(at(best))});
    }
  }
  [[nodiscard]] std::string pose_id(int pose) const {
    return comparison_.batch().measurements[static_cast<std::size_t>(pose)].pose_id;
  }

  /// The fit against which the best alternative is judged: if the tracker stands elsewhere too, the
  /// fit with that alone.
  [[nodiscard]] Fit without_the_cause(const Tried& none, const Alternative& best) const;
  [[nodiscard]] Triage told(const Tried& none) const;
  [[nodiscard]] std::string sentence(const Triage& triage) const;

  const Comparison& comparison_;
  const Alternatives& alternatives_;
  std::vector<Tried> tried_;  // alternatives that explain the batch
};

Fit Judge::without_the_cause(const Tried& none, const Alternative& best) const {
  if (!best.tracker_elsewhere) return none.fit;
  for (const Alternative& one : alternatives_.from(0, "")) {
    if (batch_triage::moves_base(record_of(one.cause))) return comparison_.fit(one);
  }
  return none.fit;
}

Triage Judge::told(const Tried& none) const {
  Triage triage;
  triage.misfit = std::sqrt(none.fit.misfit_all);
  if (tried_.empty()) {
    triage.verdict = TriageVerdict::kPoisoned;
    triage.learn = false;
    triage.misfit_after = triage.misfit;
    triage.effect_rms = std::sqrt(none.fit.residual.squaredNorm() / comparison_.poses());
    triage.effect_rotation_rms = std::sqrt(none.fit.turn.squaredNorm() / comparison_.poses());
  } else {
    const Tried& best = tried_.front();
    for (const int pose : best.fit.outliers) triage.outliers.push_back(pose_id(pose));
    triage.misfit_after = std::sqrt(best.fit.misfit);
    triage.cause = best.alternative.cause;
    triage.tracker_elsewhere = best.alternative.tracker_elsewhere;
    triage.learn = !best.alternative.harmful;
    const Fit before = without_the_cause(none, best.alternative);
    triage.effect_rms =
        std::sqrt((before.residual - best.fit.residual).squaredNorm() / comparison_.poses());
    triage.effect_rotation_rms =
        std::sqrt((before.turn - best.fit.turn).squaredNorm() / comparison_.poses());
    for (std::size_t k = 1; k < tried_.size(); ++k) {
      if (tried_[k].fit.score > best.fit.score + kDoubt ||
          tried_[k].alternative.cause.cause.empty())
        continue;
      triage.could_also_be.push_back(tried_[k].alternative.cause);
      triage.learn = triage.learn && !tried_[k].alternative.harmful;
    }
    if (triage.cause.cause.empty() && !triage.outliers.empty()) {
      triage.cause = cause_at(first_searched_by(causes::SearchFamily::kPose));
      triage.cause.pose_id = triage.outliers.front();
    }
    triage.verdict = triage.cause.cause.empty() ? TriageVerdict::kClean : TriageVerdict::kExplained;
  }
  triage.sentence = sentence(triage);
  return triage;
}

std::string what_happened(const Cause& cause) {
  const CauseRecord& record = record_of(cause);
  if (!record.whole_batch) return plain_name(record);
  return fmt::format(fmt::runtime(record.whole_batch->sentence), cause.joint + 1);
}

/// The error of positions and, where they were judged, of orientations.
std::string how_much(const Triage& triage) {
  const std::string mm = fmt::format("{:.3g} mm", to_mm(triage.effect_rms));
  if (triage.effect_rotation_rms == 0) return mm + " rms";
  return fmt::format("{} and {:.2g} deg rms", mm, to_deg(triage.effect_rotation_rms));
}

std::string Judge::sentence(const Triage& triage) const {
  const std::string bad = triage.outliers.empty()
                              ? ""
                              : fmt::format("; bad poses: {}", fmt::join(triage.outliers, ", "));
  switch (triage.verdict) {
    case TriageVerdict::kClean:
      return fmt::format("as the model in force expects it ({:.2f} of the expected deviation)",
                         triage.misfit);
    case TriageVerdict::kPoisoned:
      return fmt::format(
          "{} off the model in force ({:.3g} times the expected deviation), and nothing known "
          "explains it",
          how_much(triage), triage.misfit);
    case TriageVerdict::kExplained:
      break;
  }
  if (record_of(triage.cause).search == causes::SearchFamily::kPose) {
    return fmt::format("as the model in force expects it but for single poses: {}",
                       fmt::join(triage.outliers, ", "));
  }
  std::string text =
      triage.cause.pose_id.empty() ? "" : fmt::format("from pose {} on ", triage.cause.pose_id);
  text += what_happened(triage.cause);
  // The distance between poses as two set-ups see them says nothing of the robot.
  const bool set_up_anew =
      triage.cause.pose_id.empty() && batch_triage::moves_base(record_of(triage.cause));
  if (!set_up_anew) text += fmt::format(" ({})", how_much(triage));
  if (triage.tracker_elsewhere) text += ", and the tracker stands elsewhere";
  for (const Cause& other : triage.could_also_be) {
    text += "; or " +
            (other.pose_id.empty() ? "" : fmt::format("from pose {} on ", other.pose_id)) +
            what_happened(other);
  }
  return text + bad;
}

}  // namespace

std::string_view to_string(TriageVerdict verdict) {
  switch (verdict) {
    case TriageVerdict::kClean:
      return "clean";
    case TriageVerdict::kExplained:
      return "explained";
    case TriageVerdict::kPoisoned:
      return "poisoned";
  }
  return "poisoned";
}

Triage triage(const CompensatedModel& model, const CheckedBatch& batch) {
  return triage(model, batch, model.cell());
}

Triage triage(const CompensatedModel& model, const CheckedBatch& checked, const Cell& cell) {
  MeasurementBatch batch = known_rows(model, checked.rows());
  if (const auto doubt = reading_doubt(batch, cell)) {
    Triage poisoned;
    poisoned.verdict = TriageVerdict::kPoisoned;
    poisoned.learn = false;
    poisoned.sentence = sentence(*doubt);
    return poisoned;
  }
  if (batch.measurements.size() < kFewestPoses) {
    Triage too_few;
    too_few.sentence = fmt::format("{} poses are too few to be held against the model in force",
                                   batch.measurements.size());
    return too_few;
  }
  if (has_sessions(batch)) {
    if (Result<InWorld> world = in_world_of(model, batch)) batch = std::move(world->batch);
  }
  const Comparison comparison(model, batch);
  const Alternatives alternatives(comparison);
  return Judge(comparison, alternatives).verdict();
}

}  // namespace trammel
