#include "server/diagnose/prove/prove.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/diagnose/prove/named_curve.h"
#include "server/diagnose/prove/own_residuals.h"
#include "server/diagnose/search/naming.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

/// The two shares at which the search tries strengths in turn: one at the wanted share, and one
/// that shows how steep the curve is.
constexpr double kSharesTried[] = {kProvedShare, kProvedShare, 0.5};
constexpr double kCloseEnough = 1.3;  // upper to lower bound of a size: 15 % in either direction
constexpr double kSureOfNever = 0.975;
constexpr double kLowestOrderPutIn = 8;  // cycles a joint turn, as harmonic and strain wave gears
constexpr double kHighestOrderPutIn = 100;
constexpr double kEarliestPutIn = 0.2;  // share of the poses after which something begins
constexpr int kDrawsOfAnEffect = 20;    // until one exceeds the part that the model absorbs

/// The result of a diagnosis of an added effect.
struct Said {
  bool found = false, named = false, misnamed = false, refused = false;
};

/// A cause during its proof.
struct CauseTried {
  const Family* family = nullptr;
  const Unseen* predicted = nullptr;
  std::vector<bool> positive;  ///< its numbers that cannot be negative
  NamedCurve curve;
  std::array<PutIn, kStrengthsPutIn> sizes = {};

  [[nodiscard]] double size_of(double strength) const {
    return predicted->size_of_unit * std::sqrt(strength);
  }
  [[nodiscard]] bool is_decided() const {
    const NamedCurve::Smallest smallest = curve.smallest();
    return smallest.never > kSureOfNever ||
           (smallest.to && size_of(*smallest.to) < kCloseEnough * size_of(*smallest.from));
  }
};

/// An effect that was drawn.
struct Drawn {
  Cause cause;             ///< with its order, and the pose at which it begins
  Eigen::VectorXd effect;  ///< R, whitened
};

/// One diagnosis to make. Without a candidate no effect is added.
struct DiagnosisToMake {
  CauseTried* candidate = nullptr;
  Eigen::Index strength = 0;  ///< its place among the added effects
  std::uint64_t seed = 0;
};

void count_said(const Said& said, PutIn& size) {
  ++size.tried;
  size.found += said.found ? 1 : 0;
  size.named += said.named ? 1 : 0;
  size.misnamed += said.misnamed ? 1 : 0;
}

double standard_normal(SeededRandom& random) {
  const double radius = std::sqrt(-2 * std::log(1 - random.uniform(0, 1)));
  return radius * std::cos(random.uniform(0, 2 * kPi));
}

/// The numbers of a cause that are physical only from zero on: bounds are part of its name.
std::vector<bool> positive_numbers(const Family& family, const Cell& cell) {
  const Best typical = family.typical();
  const auto count = static_cast<std::size_t>(family.columns(typical).cols());
  const bool is_play = record_of(family.cause(typical)).search == causes::SearchFamily::kPlay;
  std::vector<bool> positive(count, is_play);
  const std::string spec = family.source(typical);
  if (spec.empty()) return positive;
  const Result<ErrorSourcePtr> source = make_error_source(spec, cell);
  if (!source || (*source)->parameters().size() != count) return positive;
  for (std::size_t k = 0; k < count; ++k)
    positive[k] = is_play || std::isfinite((*source)->parameters()[k].lower);
  return positive;
}

class Proving {
 public:
  Proving(const ToProve& what, const DiagnoseOptions& options)
      : what_(what),
        options_(options),
        residuals_(what.explained.after),
        best_(std::make_shared<Cell>(*what.cell)) {
    best_->model.error_sources = what.best;
    for (const FamilyPtr& family : what.families) add(*family);
  }

  [[nodiscard]] Proof proof() {
    for (int round = 0; options_.prove->has_time(round); ++round) {
      const std::vector<DiagnosisToMake> trials = trials_of(round);
      if (trials.empty()) break;
      diagnose_all(trials, round);
    }
    for (const CauseTried& candidate : candidates_) proof_.causes.push_back(told(candidate));
    return std::move(proof_);
  }

 private:
  /// Causes that the poses cannot show are left out, since they have no size to try.
  void add(const Family& family) {
    if (!family.named() || !family.predicts()) return;
    const Cause cause = family.cause(family.typical());
    const auto seen =
        std::find_if(what_.unseen.begin(), what_.unseen.end(),
                     [&](const Unseen& one) { return one.cause == cause && one.size_of_unit > 0; });
    if (seen == what_.unseen.end()) return;
    CauseTried candidate;
    candidate.family = &family;
    candidate.predicted = &*seen;
    candidate.positive = positive_numbers(family, *what_.cell);
    candidates_.push_back(std::move(candidate));
  }

  /// Returns a diagnosis for each undecided cause, and one without an added effect. Returns none
  /// once all causes are decided.
  [[nodiscard]] std::vector<DiagnosisToMake> trials_of(int round) {
    SeededRandom random(options_.seed + kProofDraw + static_cast<std::uint64_t>(round) * 0x10001U);
    const double share = kSharesTried[static_cast<std::size_t>(round) % std::size(kSharesTried)];
    std::vector<DiagnosisToMake> trials;
    for (CauseTried& candidate : candidates_) {
      const double drawn = random.uniform(0, 1);
      const std::uint64_t seed = random.next();
      if (!candidate.is_decided())
        trials.push_back({&candidate, candidate.curve.next(share, drawn), seed});
    }
    if (!trials.empty()) trials.push_back({nullptr, 0, random.next()});
    return trials;
  }

  void diagnose_all(const std::vector<DiagnosisToMake>& trials, int round) {
    std::vector<std::optional<Said>> said(trials.size());
    options_.prove->for_each(trials.size(), [&](std::size_t k) {
      if (options_.prove->has_time(round)) said[k] = said_of(trials[k]);
    });
    for (std::size_t k = 0; k < trials.size(); ++k) {
      if (said[k]) count(trials[k], *said[k]);
    }
  }

  void count(const DiagnosisToMake& trial, const Said& said) {
    proof_.refused += said.refused ? 1 : 0;
    if (trial.candidate == nullptr) return count_said(said, proof_.healthy);
    count_said(said, trial.candidate->sizes[static_cast<std::size_t>(trial.strength)]);
    trial.candidate->curve.count(strength_put_in(trial.strength), said.named);
  }

  [[nodiscard]] Said said_of(const DiagnosisToMake& trial) const {
    SeededRandom random(trial.seed);
    Eigen::VectorXd left = residuals_.drawn(random);
    std::optional<Drawn> put_in;
    if (trial.candidate != nullptr) {
      put_in = drawn_of(*trial.candidate, strength_put_in(trial.strength), random);
      left += put_in->effect;
    }
    MeasurementBatch batch = residuals_.measured(left);
    take_out_surrogates(what_.surrogates, batch);
    for (Measurement& m : batch.measurements) {
      m.session_id.clear();  // all rows are in one world at this point
      m.session = 0;
      m.set = MeasurementSet::kUnassigned;
    }
    batch.source_text.clear();
    const Result<CheckedBatch> checked = check_against_cell(std::move(batch), *best_);
    if (!checked) return {.refused = true};
    DiagnoseOptions own;
    own.seed = trial.seed;
    own.draws = options_.draws;
    const Result<Diagnosis> diagnosis = what_.answer(best_, *checked, own);
    if (!diagnosis) return {.refused = true};
    return judged(*diagnosis, put_in ? &put_in->cause : nullptr);
  }

  /// Draws the numbers from their priors, and scales them to `strength` after removal of the parts
  /// that the model can compensate.
  [[nodiscard]] Drawn drawn_of(const CauseTried& candidate, double strength,
                               SeededRandom& random) const {
    const Family& family = *candidate.family;
    Drawn drawn;
    double own = 0;
    for (int k = 0; k < kDrawsOfAnEffect; ++k) {
      const Best member = member_of(family, random);
      const Eigen::MatrixXd columns = family.columns(member);
      Eigen::VectorXd size(columns.cols());
      for (Eigen::Index c = 0; c < size.size(); ++c) {
        size(c) = standard_normal(random);
        if (candidate.positive[static_cast<std::size_t>(c)]) size(c) = std::abs(size(c));
      }
      drawn = {family.cause(member), columns * size};
      own = drawn.effect.dot(what_.explained.all.project(drawn.effect).col(0));
      if (own > std::pow(thresholds::kAbsorbed, 2) * drawn.effect.squaredNorm()) break;
    }
    if (own > 0) drawn.effect *= std::sqrt(strength / own);
    return drawn;
  }

  /// A member with a drawn order, number of harmonics or first pose. They are drawn among those for
  /// which a diagnosis searches.
  [[nodiscard]] Best member_of(const Family& family, SeededRandom& random) const {
    Best member = family.typical();
    const auto scales = static_cast<double>(member.length_scale + 1);
    member.length_scale = static_cast<std::size_t>(random.uniform(0, scales));
    if (member.order > 0) member.order = random.uniform(kLowestOrderPutIn, kHighestOrderPutIn);
    if (!family.cause(member).pose_id.empty()) {
      const double share = random.uniform(kEarliestPutIn, 1 - kEarliestPutIn);
      member.pose =
          static_cast<Eigen::Index>(share * static_cast<double>(what_.explained.after.poses()));
    }
    return member;
  }

  /// The same cause of the same joint and, for a gear, of the same order.
  [[nodiscard]] static bool is_named(const Cause& cause, const Cause& put_in) {
    const bool is_of_its_order = !cause.order || !put_in.order ||
                                 std::abs(*cause.order - *put_in.order) < thresholds::kSameOrder;
    return cause.cause == put_in.cause && (cause.joint == put_in.joint || put_in.joint < 0) &&
           is_of_its_order;
  }

  /// `put_in`: null if no effect was added.
  [[nodiscard]] static Said judged(const Diagnosis& diagnosis, const Cause* put_in) {
    Said said;
    for (const Finding& finding : diagnosis.findings) {
      const std::vector<Cause>& rivals = finding.could_also_be;
      said.found = said.found || put_in == nullptr || is_named(finding.cause, *put_in) ||
                   std::any_of(rivals.begin(), rivals.end(),
                               [&](const Cause& rival) { return is_named(rival, *put_in); });
      if (!rivals.empty()) continue;
      if (put_in != nullptr && is_named(finding.cause, *put_in))
        said.named = true;
      else if (put_in == nullptr || !is_description_of(finding.cause, *put_in))
        said.misnamed = true;
    }
    return said;
  }

  [[nodiscard]] static ProvedCause told(const CauseTried& candidate) {
    ProvedCause told;
    told.cause = candidate.predicted->cause;
    told.cause.pose_id.clear();  // drawn anew each time, like an order
    told.cause.order.reset();
    told.predicted = candidate.predicted->identifiable;
    for (Eigen::Index k = 0; k < kStrengthsPutIn; ++k) {
      PutIn size = candidate.sizes[static_cast<std::size_t>(k)];
      if (size.tried == 0) continue;
      size.effect_rms = candidate.size_of(strength_put_in(k));
      told.sizes.push_back(size);
    }
    const NamedCurve::Smallest smallest = candidate.curve.smallest();
    const auto size = [&](const std::optional<double>& strength) {
      return strength ? std::optional(candidate.size_of(*strength)) : std::nullopt;
    };
    told.never = smallest.never > kSureOfNever;
    if (told.sizes.empty() || told.never) return told;
    told.smallest = size(smallest.median);
    told.from = size(smallest.from);
    told.to = size(smallest.to);
    return told;
  }

  const ToProve& what_;
  const DiagnoseOptions& options_;
  OwnResiduals residuals_;
  std::shared_ptr<Cell> best_;  ///< the cell, with the best model's error sources
  std::vector<CauseTried> candidates_;
  Proof proof_;
};

}  // namespace

Proof proof_of(const ToProve& what, const DiagnoseOptions& options) {
  TRAMMEL_CHECK(options.prove && options.prove->has_time && options.prove->for_each);
  return Proving(what, options).proof();
}

}  // namespace trammel::cause_search
