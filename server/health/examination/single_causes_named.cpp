// Single causes, one after the other: the likeliest is refitted, and the rest is looked at again.
#include <algorithm>
#include <cmath>

#include "server/health/evidence/noisier_rows.h"
#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"
#include "server/numerics/chi_square.h"

namespace trammel::health {

using Eigen::Index;

namespace {

constexpr int kMostCauses = 3;       // most causes that a check names
constexpr int kRounds = 3;           // in which each named cause is tested again beside the others
constexpr double kEven = 1e-3;       // of scores: rounding
constexpr double kUnlinear = 0.003;  // of an effect
constexpr double kNearlySeen =
    10;  // times the limit: a cause that is named where the whole is beyond chance
constexpr double kLeastRest = 1e-12;  // of residuals: less is rounding
constexpr double kWorseInstrument =
    5;  // times a healthy robot's residuals: an instrument may scatter so

/// The number of a zero, and its variance, by the whole kinematics: one that is off by a degree
/// does not act linearly.
std::optional<Estimate> found_alone(const std::vector<ZerosFit>& fits, std::size_t zero,
                                    Index column) {
  for (const ZerosFit& fit : fits)
    if (!fit.tool && fit.zeros == std::vector<std::size_t>{zero})
      return Estimate{fit.at.segment(column, 1), fit.covariance.topLeftCorner(1, 1)};
  return std::nullopt;
}

}  // namespace

void Examination::look_for_changes(const CheckTests& healthy) {
  always_ = frames_of(rows_);
  for (const int pose : sifted_.bad)
    always_ = joined(
        always_, questions_.hypotheses[questions_.causes + static_cast<std::size_t>(pose)].columns);
  nuisance_ = always_;
  off_ = distance_of(healthy.rows());
  is_far_ = off_ > kFarOff;
  if (look_once(healthy) && !is_far_) {
    while (static_cast<int>(named_.size()) < kMostCauses &&
           look_once(CheckTests(covariance_, nuisance_, questions_))) {
    }
    look_back();
  }
  for (std::size_t k = 0; k < named_.size(); ++k)
    tell_change(named_[k], named_.size() == 1 ? healthy : beside_others(k));
  if (!named_.empty()) tell_what_is_left();
}

/// Adds a note to each change if several zeros explain as much, and if a residual is left beside
/// all changes.
void Examination::tell_what_is_left() {
  const CheckTests tests(covariance_, nuisance_, questions_);
  const bool is_all =
      tests.smallest_p(tests.rows().left(rows_.residual)) >= healthy_.limit(options_.false_alarm);
  const RefittedRows named(rows_.covariance, nuisance_);
  const double left = named.left(rows_.residual).squaredNorm();
  const int numbers = RefittedRows(rows_.covariance, always_).freedom() - named.freedom();
  tell_instrument(check_.changed);
  for (SeenChange& change : check_.changed) {
    tell_several_zeros(left, numbers, change);
    if (!is_all) add_rival(unknown_cause(), change);
  }
}

bool Examination::look_once(const CheckTests& tests) {
  const Eigen::VectorXd left = tests.rows().left(rows_.residual);
  const double smallest = tests.smallest_p(left);
  const double limit = healthy_.limit(options_.false_alarm);
  if (smallest >= limit) return false;
  const double chance = healthy_.chance_of(smallest);
  const std::optional<std::size_t> best = likeliest(tests, left);
  const auto is_all_of_it = [&](std::size_t cause) {
    const RefittedRows without(covariance_,
                               joined(nuisance_, questions_.hypotheses[cause].columns));
    return distance_of(without) < kFarOff;
  };
  if (is_far_ && !(best && is_tool(*best) && is_all_of_it(*best))) {
    doubt_.is_too_far = true;
    return false;
  }
  const auto is_seen = [&](std::size_t cause) {
    return tests.p_value(cause, left) < kNearlySeen * limit;
  };
  const bool fits = best && is_seen(*best) && !is_scatter(*best, tests, left);
  if (fits) {
    named_.push_back({*best, chance});
    refit_named();
  } else if (named_.empty() && questions_.causes > 0) {
    const std::size_t most = most_explained(tests, left);
    const double scatter = std::sqrt(left.squaredNorm() / tests.rows().freedom());
    if (is_scatter(most, tests, left) && scatter < kWorseInstrument) {
      doubt_.scatter = scatter;
    } else if (tests.whole_p(left) < limit || is_seen(most)) {
      unknown_found(chance, left, tests.rows().freedom());
    }
  }
  return fits;
}

std::size_t Examination::most_explained(const CheckTests& tests,
                                        const Eigen::VectorXd& left) const {
  const std::vector<double> scores = tests.scores(left);
  return static_cast<std::size_t>(
      std::max_element(scores.begin(),
                       scores.begin() + static_cast<std::ptrdiff_t>(questions_.causes)) -
      scores.begin());
}

std::optional<std::size_t> Examination::likeliest(const CheckTests& tests,
                                                  const Eigen::VectorXd& left) const {
  std::vector<double> scores = tests.scores(left);
  scores.resize(questions_.causes);
  // If a joint stays at one angle, every function of that angle acts like its zero, which is
  // simpler.
  for (std::size_t h = 0; h < scores.size(); ++h)
    if (is_zero(effects_.causes()[questions_.hypotheses[h].cause].cause)) scores[h] += kEven;
  while (!scores.empty()) {
    const auto best = std::max_element(scores.begin(), scores.end());
    const auto hypothesis = static_cast<std::size_t>(best - scores.begin());
    if (*best <= 0) return std::nullopt;
    if (!is_extrapolated(hypothesis, tests.rows()) && may_be_named(hypothesis, tests, left))
      return hypothesis;
    *best = 0;
  }
  return std::nullopt;
}

/// Beside all rows being noisier alike, positions alone, or orientations alone.
bool Examination::is_scatter(std::size_t hypothesis, const CheckTests& tests,
                             const Eigen::VectorXd& left) const {
  const double whole = left.squaredNorm();
  const double rest = whole - (tests.directions()[hypothesis].transpose() * left).squaredNorm();
  const double gained =
      tests.rows().freedom() * std::log(whole / std::max(rest, kLeastRest * whole));
  const double least =
      price(tests.freedom(hypothesis)) + 2 * std::log(static_cast<double>(questions_.causes));
  if (gained < least) return true;
  if (std::none_of(rows_.count.begin(), rows_.count.end(), [](Index count) { return count > 3; }))
    return false;
  const Eigen::MatrixXd& own = questions_.hypotheses[hypothesis].columns;
  return gained_beside_noise(rows_, covariance_, nuisance_, own, RowKind::kPositions) < least ||
         gained_beside_noise(rows_, covariance_, nuisance_, own, RowKind::kOrientations) < least;
}

/// A cause of any form explains a part of nearly everything, so it is named only if it leaves no
/// residual.
bool Examination::may_be_named(std::size_t hypothesis, const CheckTests& tests,
                               const Eigen::VectorXd& left) const {
  if (!effects_.causes()[questions_.hypotheses[hypothesis].cause].cause.any_function) return true;
  const int freedom = tests.rows().freedom() - tests.freedom(hypothesis);
  const double rest =
      left.squaredNorm() - (tests.directions()[hypothesis].transpose() * left).squaredNorm();
  return freedom > 0 && chi_square_tail(rest, freedom) >= healthy_.limit(options_.false_alarm);
}

CheckTests Examination::beside_others(std::size_t k) const {
  Eigen::MatrixXd refitted = always_;
  for (std::size_t other = 0; other < named_.size(); ++other)
    if (other != k)
      refitted = joined(refitted, questions_.hypotheses[named_[other].hypothesis].columns);
  return CheckTests(covariance_, refitted, questions_);
}

void Examination::refit_named() {
  covariance_ = rows_.covariance;
  nuisance_ = always_;
  for (std::size_t k = 0; k < named_.size(); ++k) {
    const Eigen::MatrixXd& columns = questions_.hypotheses[named_[k].hypothesis].columns;
    const Estimate found =
        estimated(named_[k].hypothesis, RefittedRows(rows_.covariance, nuisance_));
    covariance_.diagonal() += (kUnlinear * columns * found.numbers).cwiseAbs2();
    nuisance_ = joined(nuisance_, columns);
  }
}

void Examination::look_back() {
  const double limit = healthy_.limit(options_.false_alarm);
  bool settled = false;
  for (int round = 0; round < kRounds && !settled; ++round) {
    settled = true;
    for (std::size_t k = 0; k < named_.size() && named_.size() > 1; ++k) {
      const CheckTests tests = beside_others(k);
      const Eigen::VectorXd left = tests.rows().left(rows_.residual);
      const double smallest = tests.smallest_p(left);
      const std::optional<std::size_t> best = likeliest(tests, left);
      if (smallest < limit && best == named_[k].hypothesis) continue;
      settled = false;
      if (smallest < limit && best) {
        named_[k] = {*best, healthy_.chance_of(smallest)};
      } else {
        named_.erase(named_.begin() + static_cast<std::ptrdiff_t>(k--));
      }
      refit_named();
    }
  }
}

void Examination::tell_change(const Named& named, const CheckTests& tests) {
  const Estimate found = estimated(named.hypothesis, tests.rows());
  const Hypothesis& one = questions_.hypotheses[named.hypothesis];
  const CauseEffects::Entry& entry = effects_.causes()[one.cause];
  SeenChange change;
  change.cause = entry.cause;
  change.p_value = named.chance;
  set_size(size(named.hypothesis, found), found, square_here(one.columns, tests.rows()), change);
  const double scale = effects_.scale(entry.columns.front());
  const bool is_all = named_.size() == 1 && sifted_.bad.empty();
  const Estimate zero =
      is_all ? found_alone(fits_, one.cause, entry.columns.front()).value_or(found) : found;
  if (std::find(zeros_.causes().begin(), zeros_.causes().end(), one.cause) != zeros_.causes().end())
    change.zeros.push_back({entry.cause.joint, scale * zero.numbers(0),
                            2 * scale * std::sqrt(zero.covariance(0, 0)), change.effect_rms,
                            change.u95});
  tell_rivals(named.hypothesis, tests, tests.scores(tests.rows().left(rows_.residual)), change);
  if (is_tool(named.hypothesis)) {
    Eigen::MatrixXd others = always_;
    std::vector<std::size_t> causes;
    for (const Named& other : named_) {
      const Hypothesis& also = questions_.hypotheses[other.hypothesis];
      if (other.hypothesis != named.hypothesis) others = joined(others, also.columns);
      causes.push_back(also.cause);
    }
    tell_zeros_in_tool(rows_, others, causes, change);
  }
  check_.changed.push_back(std::move(change));
}

void Examination::unknown_found(double chance, const Eigen::VectorXd& left, int freedom) {
  SeenChange change;
  change.cause = unknown_cause();
  change.p_value = chance;
  change.at_these_poses = true;
  double noise = 0;  // m, of one axis
  for (std::size_t i = 0; i < rows_.poses(); ++i)
    noise += covariance_.diagonal().segment<3>(rows_.first[i]).sum();
  noise = noise / static_cast<double>(rows_.poses());
  const double beyond = std::max(left.squaredNorm() / freedom - 1, 0.0);
  change.effect_rms = std::sqrt(noise * beyond);
  change.u95 = std::sqrt(noise * 2 * std::sqrt(2.0 / freedom));
  check_.changed.push_back(std::move(change));
}

}  // namespace trammel::health
