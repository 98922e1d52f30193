// A check's residuals are tested for each single cause beside base (and tool), for single bad poses, and as a whole.
// What explains most for its number of parameters (Schwarz's price, log R for each) is taken: a bad pose is refitted
// with the base, a cause is a change, and the rest is tested again. Effects are linear in the cause; of a large one
// kUnlinear may be left over.
#include "server/health/health_check.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <numeric>

#include "server/base/units.h"
#include "server/calibrate/batch_check.h"
#include "server/compensate/known_rows.h"
#include "server/health/evidence/check_tests.h"
#include "server/health/evidence/working_poses.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

using Eigen::Index;
using health::CheckRows;
using health::CheckTests;
using health::HealthyChecks;
using health::Hypothesis;
using health::RefittedRows;
using health::Sifted;

constexpr int kMostCauses = 3;         // that a check may name
constexpr int kRounds = 3;             // of looking at each of them again beside the others
constexpr double kAlike = 6;           // of scores: odds of e^3
constexpr double kCredible = 0.99;     // of all single causes' odds: those that could be it have it together
constexpr double kUnlinear = 0.003;    // of an effect
constexpr double kDoubtful = 0.02;     // chance from which on nothing is said for certain
constexpr double kNearlySeen = 10;     // times the limit: a cause that is named where the whole is beyond chance
constexpr double kExtrapolated = 10;   // times what the poses are off by: an effect that large is not seen in them
constexpr double kFarOff = kNeverOff;  // m rms, base refitted: no small change, and effects are no longer linear

Eigen::MatrixXd joined(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  Eigen::MatrixXd both(one.rows(), one.cols() + other.cols());
  both << one, other;
  return both;
}

/// Unix time, s; empty: not known.
struct CheckTimes {
  std::optional<std::int64_t> model, check;
};

std::string date_of(std::int64_t unix_s) {
  const std::time_t time = unix_s;
  std::tm utc{};
  gmtime_r(&time, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

/// How large an effect is over the working poses, and U(k=2).
struct Size {
  double rms = 0, u95 = 0;
};

/// One check, while it is looked through.
class Examination {
 public:
  Examination(const HealthOptions& options, const CauseEffects& effects, const WorkingPoses& working, CheckRows rows,
              int tail_freedom)
      : options_(options),
        effects_(effects),
        working_(working),
        rows_(std::move(rows)),
        signals_(working.signals(effects, options.seed)),
        questions_(questions()),
        healthy_(rows_, frames(), questions_, tail_freedom, options.seed),
        covariance_(rows_.covariance) {}

  HealthCheck result(const CheckTimes& times) {
    check_.poses = static_cast<int>(rows_.poses());
    check_.tolerance = options_.tolerance;
    check_.not_asked = effects_.not_asked();
    sifted_ = healthy_.sifted(rows_.residual);
    for (const int pose : sifted_.bad) check_.suspects.push_back(rows_.pose_ids[static_cast<std::size_t>(pose)]);
    check_.p_value = healthy_.chance_of(sifted_.smallest_p);
    const CheckTests& tests = healthy_.tests(sifted_.bad);
    look_for_changes(tests);
    tell_rms(tests.rows());
    tell_smallest(tests);
    tell_due(tests.rows(), times);
    tell_verdict();
    return std::move(check_);
  }

 private:
  /// A cause that was found, and the chance of as much in a healthy check.
  struct Named {
    std::size_t hypothesis = 0;
    double chance = 1;
  };

  [[nodiscard]] health::Questions questions() const {
    health::Questions questions{health::cause_hypotheses(effects_, rows_, signals_), 0};
    questions.causes = questions.hypotheses.size();
    for (Hypothesis& pose : health::pose_hypotheses(rows_)) questions.hypotheses.push_back(std::move(pose));
    return questions;
  }
  /// Refitted in a healthy robot.
  [[nodiscard]] Eigen::MatrixXd frames() const {
    if (!options_.new_tool) return rows_.by_base;
    return joined(rows_.by_base, rows_.by_cause(Eigen::all, effects_.tool_columns()));
  }
  void look_for_changes(const CheckTests& healthy);
  /// m rms of the positions, refitted.
  [[nodiscard]] double distance_of(const RefittedRows& refitted) const;
  /// Whether the cause is a tool that sits elsewhere, whose shift stays linear however far it is.
  [[nodiscard]] bool is_tool(std::size_t hypothesis) const;
  /// Whether a cause was found, and the rest is to be looked at again.
  bool look_once(const CheckTests& tests);
  /// Each cause once more beside the others: one that they make needless goes, one that now fits better comes.
  void look_back();
  /// The cause that explains most for its price; empty: none explains anything.
  [[nodiscard]] std::optional<std::size_t> likeliest(const CheckTests& tests, const Eigen::VectorXd& left) const;
  /// The same, though its size may be far beyond what these poses show.
  [[nodiscard]] std::size_t most_explained(const CheckTests& tests, const Eigen::VectorXd& left) const;
  /// Refitted besides: all that were named but the one at `k`.
  [[nodiscard]] CheckTests beside_others(std::size_t k) const;
  void refit_named();
  [[nodiscard]] Size size(std::size_t hypothesis, const RefittedRows& refitted, Eigen::VectorXd* theta) const;
  /// Whether it would do far more elsewhere than these poses are off by: they do not show it.
  [[nodiscard]] bool is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const;
  void tell_change(const Named& named, const CheckTests& tests);
  void tell_rivals(std::size_t hypothesis, const CheckTests& tests, const std::vector<double>& scores,
                   SeenChange& change) const;
  [[nodiscard]] std::vector<bool> credible(const std::vector<double>& scores) const;
  void unknown_found(double chance, const Eigen::VectorXd& left, int freedom);
  void tell_rms(const RefittedRows& refitted);
  void tell_due(const RefittedRows& refitted, const CheckTimes& times);
  [[nodiscard]] std::vector<double> misfits_of_drift(const RefittedRows& refitted) const;
  [[nodiscard]] Eigen::VectorXd rows_of(const CauseSignal& signal) const;
  [[nodiscard]] std::vector<double> strengths(std::size_t cause, const RefittedRows& refitted) const;
  void tell_smallest(const CheckTests& tests);
  void tell_verdict();
  [[nodiscard]] std::string seen_in_words() const;

  const HealthOptions& options_;
  const CauseEffects& effects_;
  const WorkingPoses& working_;
  const CheckRows rows_;
  const std::vector<CauseSignal> signals_;
  const health::Questions questions_;
  HealthyChecks healthy_;
  Sifted sifted_;
  Eigen::MatrixXd covariance_;  // with what a change that was found may leave over
  Eigen::MatrixXd always_;      // refitted: frames and bad poses
  Eigen::MatrixXd nuisance_;    // the same and changes that were found
  std::vector<Named> named_;
  double off_ = 0;           // m rms of the positions
  bool is_far_ = false;      // only a tool that sits elsewhere is named
  bool is_too_far_ = false;  // nothing is
  HealthCheck check_;
};

/// Of columns with `own` (R x k, whitened, refitted), fitted to `left`.
Size size_of(const Eigen::MatrixXd& own, const Eigen::VectorXd& left, const Eigen::MatrixXd& left_square,
             Eigen::VectorXd* theta) {
  const auto solver = own.completeOrthogonalDecomposition();
  *theta = solver.solve(left);
  const Eigen::MatrixXd inverse = solver.pseudoInverse();
  const Eigen::MatrixXd covariance = inverse * inverse.transpose();
  const double found = theta->dot(left_square * *theta);
  const double by_noise = (left_square * covariance).trace();
  const double rms = std::sqrt(std::max(found - by_noise, 0.0));
  const Eigen::VectorXd gradient = left_square * *theta / std::max(std::sqrt(found), 1e-12);
  return {rms, 2 * std::sqrt(gradient.dot(covariance * gradient))};
}

/// Of a joint's angle that is off by anything at each pose.
Size size_of_any(const Eigen::MatrixXd& own, const Eigen::VectorXd& left, double working_rms, Eigen::VectorXd* theta) {
  const auto solver = own.completeOrthogonalDecomposition();
  *theta = solver.solve(left);
  const Eigen::MatrixXd inverse = solver.pseudoInverse();
  const double poses = static_cast<double>(theta->size());
  const double by_noise = inverse.squaredNorm() / poses;
  const double square = std::max(theta->squaredNorm() / poses - by_noise, 0.0);
  return {working_rms * std::sqrt(square), 2 * working_rms * std::sqrt(by_noise / 2)};
}

void Examination::look_for_changes(const CheckTests& healthy) {
  always_ = frames();
  for (const int pose : sifted_.bad)
    always_ = joined(always_, questions_.hypotheses[questions_.causes + static_cast<std::size_t>(pose)].columns);
  nuisance_ = always_;
  off_ = distance_of(healthy.rows());
  is_far_ = off_ > kFarOff;
  if (look_once(healthy) && !is_far_) {
    while (static_cast<int>(named_.size()) < kMostCauses && look_once(CheckTests(covariance_, nuisance_, questions_))) {
    }
    look_back();
  }
  for (std::size_t k = 0; k < named_.size(); ++k)
    tell_change(named_[k], named_.size() == 1 ? healthy : beside_others(k));
}

bool Examination::look_once(const CheckTests& tests) {
  const Eigen::VectorXd left = tests.rows().left(rows_.residual);
  const double smallest = tests.smallest_p(left);
  const double limit = healthy_.limit(options_.false_alarm);
  if (smallest >= limit) return false;
  const double chance = healthy_.chance_of(smallest);
  const std::optional<std::size_t> best = likeliest(tests, left);
  if (is_far_ && !(best && is_tool(*best))) {
    is_too_far_ = true;
    return false;
  }
  const auto is_seen = [&](std::size_t cause) { return tests.p_value(cause, left) < kNearlySeen * limit; };
  const bool fits = best && is_seen(*best);
  if (fits) {
    named_.push_back({*best, chance});
    refit_named();
  } else if (named_.empty() &&
             (tests.whole_p(left) < limit || (questions_.causes > 0 && is_seen(most_explained(tests, left))))) {
    unknown_found(chance, left, tests.rows().freedom());
  }
  return fits;
}

std::size_t Examination::most_explained(const CheckTests& tests, const Eigen::VectorXd& left) const {
  const std::vector<double> scores = tests.scores(left);
  return static_cast<std::size_t>(
      std::max_element(scores.begin(), scores.begin() + static_cast<std::ptrdiff_t>(questions_.causes)) -
      scores.begin());
}

std::optional<std::size_t> Examination::likeliest(const CheckTests& tests, const Eigen::VectorXd& left) const {
  std::vector<double> scores = tests.scores(left);
  scores.resize(questions_.causes);
  while (!scores.empty()) {
    const auto best = std::max_element(scores.begin(), scores.end());
    const auto hypothesis = static_cast<std::size_t>(best - scores.begin());
    if (*best <= 0) return std::nullopt;
    if (!is_extrapolated(hypothesis, tests.rows())) return hypothesis;
    *best = 0;
  }
  return std::nullopt;
}

CheckTests Examination::beside_others(std::size_t k) const {
  Eigen::MatrixXd refitted = always_;
  for (std::size_t other = 0; other < named_.size(); ++other)
    if (other != k) refitted = joined(refitted, questions_.hypotheses[named_[other].hypothesis].columns);
  return CheckTests(covariance_, refitted, questions_);
}

void Examination::refit_named() {
  covariance_ = rows_.covariance;
  nuisance_ = always_;
  for (std::size_t k = 0; k < named_.size(); ++k) {
    const Eigen::MatrixXd& columns = questions_.hypotheses[named_[k].hypothesis].columns;
    Eigen::VectorXd theta;
    static_cast<void>(size(named_[k].hypothesis, RefittedRows(rows_.covariance, nuisance_), &theta));
    covariance_.diagonal() += (kUnlinear * columns * theta).cwiseAbs2();
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

double Examination::distance_of(const RefittedRows& refitted) const {
  const Eigen::VectorXd left = refitted.unwhitened(refitted.left(rows_.residual));
  double square = 0;
  for (const Index first : rows_.first) square += left.segment<3>(first).squaredNorm();
  return std::sqrt(square / static_cast<double>(rows_.poses()));
}

bool Examination::is_tool(std::size_t hypothesis) const {
  return effects_.causes()[questions_.hypotheses[hypothesis].cause].columns == effects_.tool_columns();
}

Size Examination::size(std::size_t hypothesis, const RefittedRows& refitted, Eigen::VectorXd* theta) const {
  const Hypothesis& one = questions_.hypotheses[hypothesis];
  const CauseEffects::Entry& entry = effects_.causes()[one.cause];
  const Eigen::VectorXd left = refitted.left(rows_.residual);
  const Eigen::MatrixXd own = refitted.left(one.columns);
  return entry.cause.any_function ? size_of_any(own, left, working_.any_function_rms(entry.columns.front()), theta)
                                  : size_of(own, left, working_.left_square(entry.columns), theta);
}

bool Examination::is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const {
  Eigen::VectorXd theta;
  return size(hypothesis, refitted, &theta).rms > kExtrapolated * off_;
}

void Examination::tell_change(const Named& named, const CheckTests& tests) {
  Eigen::VectorXd theta;
  const Size sized = size(named.hypothesis, tests.rows(), &theta);
  const CauseEffects::Entry& entry = effects_.causes()[questions_.hypotheses[named.hypothesis].cause];
  SeenChange change{entry.cause, sized.rms, sized.u95, named.chance, {}};
  tell_rivals(named.hypothesis, tests, tests.scores(tests.rows().left(rows_.residual)), change);
  check_.changed.push_back(std::move(change));
}

/// The most likely single causes that together have kCredible of the odds: many that are each unlikely may hold the
/// true one.
std::vector<bool> Examination::credible(const std::vector<double>& scores) const {
  std::vector<std::size_t> order(questions_.causes);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
  const auto odds = [&](std::size_t h) { return std::exp(0.5 * (scores[h] - scores[order.front()])); };
  double left = 0;
  for (const std::size_t h : order) left += odds(h);
  const double missed = (1 - kCredible) * left;
  std::vector<bool> likely(questions_.causes, false);
  for (const std::size_t h : order) {
    if (left < missed) break;
    likely[h] = true;
    left -= odds(h);
  }
  return likely;
}

void Examination::tell_rivals(std::size_t hypothesis, const CheckTests& tests, const std::vector<double>& scores,
                              SeenChange& change) const {
  // What a cause explains whatever it costs: one with more numbers may be the true one all the same.
  const double price = std::log(static_cast<double>(rows_.residual.size()));
  const auto explained = [&](std::size_t h) { return scores[h] + price * tests.freedom(h); };
  const auto add = [&](const SingleCause& other) {
    const auto same = [&](const SingleCause& known) { return same_cause(known, other); };
    const bool known = std::any_of(change.could_also_be.begin(), change.could_also_be.end(), same);
    if (!known && !same(change.cause)) change.could_also_be.push_back(other);
  };
  const std::vector<bool> likely = credible(scores);
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const SingleCause& other = effects_.causes()[questions_.hypotheses[h].cause].cause;
    const bool as_much = !other.any_function && explained(h) > explained(hypothesis) - kAlike;
    if (as_much || likely[h] || scores[h] > scores[hypothesis] - kAlike) add(other);
  }
  if (!change.cause.any_function) return;
  for (const causes::Rival& rival : change.cause.record->rivals) {
    const CauseRecord* record = find_cause(rival.cause);
    if (record != nullptr && record->scope == causes::Scope::kJoint) add({record, change.cause.joint, {}, false});
  }
}

void Examination::unknown_found(double chance, const Eigen::VectorXd& left, int freedom) {
  SeenChange change;
  change.cause.record = &cause_that_stands_for(causes::StandsFor::kNoKnownCause);
  change.p_value = chance;
  double noise = 0;  // m, of one axis
  for (std::size_t i = 0; i < rows_.poses(); ++i) noise += covariance_.diagonal().segment<3>(rows_.first[i]).sum();
  noise = noise / static_cast<double>(rows_.poses());
  const double beyond = std::max(left.squaredNorm() / freedom - 1, 0.0);
  change.effect_rms = std::sqrt(noise * beyond);
  change.u95 = std::sqrt(noise * 2 * std::sqrt(2.0 / freedom));
  check_.changed.push_back(std::move(change));
}

/// Of the poses that count, as they are and as a healthy robot's would be.
void Examination::tell_rms(const RefittedRows& refitted) {
  const Eigen::VectorXd left = refitted.unwhitened(refitted.left(rows_.residual));
  const Eigen::MatrixXd expected = refitted.unwhitened_covariance();
  double square = 0, expected_square = 0;
  for (std::size_t i = 0; i < rows_.poses(); ++i) {
    const auto& bad = check_.suspects;
    if (std::find(bad.begin(), bad.end(), rows_.pose_ids[i]) != bad.end()) continue;
    square += left.segment<3>(rows_.first[i]).squaredNorm();
    expected_square += expected.diagonal().segment<3>(rows_.first[i]).sum();
  }
  const auto count = static_cast<double>(std::max<std::size_t>(rows_.poses() - check_.suspects.size(), 1));
  check_.rms = std::sqrt(square / count);
  check_.expected_rms = std::sqrt(expected_square / count);
}

/// lambda of each signal of a cause, of 1 m rms.
std::vector<double> Examination::strengths(std::size_t cause, const RefittedRows& refitted) const {
  std::vector<double> strengths;
  for (const CauseSignal& signal : signals_) {
    if (signal.cause == cause) strengths.push_back(refitted.left(rows_of(signal)).squaredNorm());
  }
  return strengths;
}

/// From what the next check follows; `since`: s from the model to this check.
std::string because_of(const DriftRate& rate, double since) {
  constexpr double kDay = 86400;  // s
  constexpr double kMonth = 30 * kDay;
  if (rate.checks == 1) {
    return fmt::format(
        "since the model was measured, {:.0f} days before, the arm has drifted by at most {:.3f} mm rms (95 %)",
        since / kDay, 2 * to_mm(DriftRate::after(rate.most, since)));
  }
  return fmt::format(
      "by {} checks over {:.0f} days the arm drifts by {:.3f} mm rms in 30 days ({:.3f} to {:.3f}, 95 %)", rate.checks,
      rate.span / kDay, to_mm(DriftRate::after(rate.best, kMonth)), to_mm(DriftRate::after(rate.least, kMonth)),
      to_mm(DriftRate::after(rate.most, kMonth)));
}

/// How likely each variance of a drift is, by the residuals: the effects of all single causes are normal, alike.
std::vector<double> Examination::misfits_of_drift(const RefittedRows& refitted) const {
  Eigen::MatrixXd drift(rows_.residual.size(), static_cast<Index>(signals_.size()));
  for (std::size_t s = 0; s < signals_.size(); ++s)
    drift.col(static_cast<Index>(s)) = refitted.left(rows_of(signals_[s]));
  drift /= std::sqrt(static_cast<double>(signals_.size()));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> along(drift * drift.transpose());
  const Eigen::VectorXd left = along.eigenvectors().transpose() * refitted.left(rows_.residual);
  std::vector<double> misfits;
  for (const double variance : drift_variances()) {
    const Eigen::ArrayXd all = 1 + variance * along.eigenvalues().array().max(0.0);
    misfits.push_back((all.log() + left.array().square() / all).sum());
  }
  const double least = *std::min_element(misfits.begin(), misfits.end());
  for (double& misfit : misfits) misfit -= least;
  return misfits;
}

/// The effect of the drift may be above the tolerance (95 %) when it has grown that large at the highest rate that all
/// checks together leave likely (95 %).
void Examination::tell_due(const RefittedRows& refitted, const CheckTimes& times) {
  constexpr double kDay = 86400;  // s
  if (!check_.changed.empty()) {
    check_.due_because = "what changed comes first: train again, then check";
    return;
  }
  if (!times.model || !times.check || static_cast<double>(*times.check - *times.model) < kDay) {
    check_.due_because = times.model && times.check ? "the model's own measurements are less than a day older"
                                                    : "it is not known when the model and the check were measured";
    return;
  }
  check_.drift = DriftSeen{*times.model, *times.check, misfits_of_drift(refitted)};
  std::vector<DriftSeen> seen = options_.earlier;
  seen.push_back(*check_.drift);
  check_.drift_rate = drift_rate(seen);
  const DriftRate& rate = *check_.drift_rate;
  constexpr double kFarthest = 2 * 365.25 * kDay;
  const double until = (options_.tolerance * options_.tolerance) / (4 * rate.most);
  const double since = static_cast<double>(*times.check - *times.model);
  const double due = static_cast<double>(*times.model) + std::min(until, since + kFarthest);
  check_.due = date_of(static_cast<std::int64_t>(std::max(due, static_cast<double>(*times.check))));
  check_.due_because = because_of(rate, since);
}

/// What it does at the poses of the check.
Eigen::VectorXd Examination::rows_of(const CauseSignal& signal) const {
  const SingleCause& asked = effects_.causes()[signal.cause].cause;
  Eigen::VectorXd rows = rows_.by_cause * signal.weights;
  for (std::size_t i = 0; asked.any_function && i < rows_.poses(); ++i) {
    const double q = rows_.contexts[i].q(asked.joint);
    rows.segment(rows_.first[i], rows_.count[i]) *= std::sin(signal.order * q + signal.phase);
  }
  return rows;
}

void Examination::tell_smallest(const CheckTests& tests) {
  const double limit = healthy_.limit(options_.false_alarm);
  bool all_seen = tests.rows().freedom() >= 1 && questions_.causes > 0;
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const std::size_t cause = questions_.hypotheses[h].cause;
    const auto rms = smallest_seen(strengths(cause, tests.rows()), tests.freedom(h), limit, options_.power);
    all_seen = all_seen && rms.has_value();
    check_.smallest.push_back({effects_.causes()[cause].cause, rms});
  }
  std::stable_sort(check_.smallest.begin(), check_.smallest.end(), [](const auto& a, const auto& b) {
    constexpr double kUnseen = 1e9;
    return a.rms.value_or(kUnseen) > b.rms.value_or(kUnseen);
  });
  if (all_seen) check_.would_have_seen = check_.smallest.front().rms;
}

std::string Examination::seen_in_words() const {
  std::string text;
  for (const SeenChange& change : check_.changed) {
    text += fmt::format("{}{}: {:.3f} +- {:.3f} mm rms over the working poses", text.empty() ? "" : "; ",
                        in_words(change.cause), to_mm(change.effect_rms), to_mm(change.u95));
    for (const SingleCause& other : change.could_also_be) text += ", or " + in_words(other);
  }
  return text;
}

void Examination::tell_verdict() {
  const double tolerance = to_mm(options_.tolerance);
  // Far beyond anything expected is never chance, whatever the tails of the model's errors are.
  if (check_.changed.empty() && check_.rms > std::max(kFarOff, kNeverExpected * check_.expected_rms))
    is_too_far_ = true;
  if (is_too_far_) {
    check_.sentence = fmt::format(
        "the poses are off by {:.1f} mm rms, which no small change explains: was the file read as it was meant "
        "(measurements, "
        "not targets; no rows or columns exchanged), is it this robot, is it this tool? `diagnose` says more",
        to_mm(check_.rms));
  } else if (!check_.changed.empty()) {
    check_.verdict = HealthVerdict::kChanged;
    check_.sentence = "the robot is not as its model has it; " + seen_in_words();
  } else if (check_.p_value < kDoubtful) {
    check_.sentence = fmt::format(
        "these poses are less like the model than {:.1f} % of healthy checks are, which may be chance: measure again",
        100 * (1 - check_.p_value));
  } else if (!check_.would_have_seen) {
    check_.sentence = "these poses are too few, or too much alike, to show every change";
  } else if (*check_.would_have_seen > options_.tolerance) {
    check_.sentence = fmt::format("these poses could hide {} of {:.3f} mm, the tolerance is {:.3f} mm",
                                  in_words(check_.smallest.front().cause), to_mm(*check_.would_have_seen), tolerance);
  } else if (!check_.suspects.empty()) {
    check_.sentence = fmt::format(
        "pose {} fits neither the model nor the other poses, which are as the model has them: it was measured wrongly, "
        "or "
        "something changed that shows only there; measure it again",
        fmt::join(check_.suspects, ", "));
    return;
  } else {
    check_.verdict = HealthVerdict::kHealthy;
    check_.sentence = fmt::format(
        "as its model has it; a change of {:.3f} mm would have been seen, the tolerance is "
        "{:.3f} mm",
        to_mm(*check_.would_have_seen), tolerance);
  }
  if (!check_.suspects.empty())
    check_.sentence += fmt::format("; left out as bad: pose {}", fmt::join(check_.suspects, ", "));
}

/// What cannot even be begun.
HealthCheck too_few(const MeasurementBatch& batch, const HealthOptions& options, const std::string& why) {
  HealthCheck check;
  check.poses = static_cast<int>(batch.measurements.size());
  check.tolerance = options.tolerance;
  check.sentence = why;
  return check;
}

}  // namespace

std::string_view to_string(HealthVerdict verdict) {
  switch (verdict) {
    case HealthVerdict::kHealthy:
      return "healthy";
    case HealthVerdict::kChanged:
      return "changed";
    case HealthVerdict::kCannotTell:
      return "cannot_tell";
  }
  return "cannot_tell";
}

Result<HealthCheck> check_health(const CompensatedModel& model, const CheckedBatch& batch,
                                 const HealthOptions& options) {
  if (const Status positions = require_positions(batch.rows(), "a check"); !positions)
    return tl::make_unexpected(positions.error());
  if (has_sessions(batch.rows())) {
    return refused("a check is one set-up of the instrument, the batch has {}", batch.rows().sessions.size())
        .in("batch " + batch.id())
        .of("session_id")
        .next("check each session by itself");
  }
  if (std::optional<Error> doubt = reading_doubt(batch.rows(), model.cell()))
    return tl::make_unexpected(std::move(*doubt));
  const MeasurementBatch known = known_rows(model, batch.rows());
  if (known.measurements.empty()) {
    return refused("no pose has a tool and payload that model {} was trained with", model.provenance().id)
        .in("batch " + batch.id());
  }
  const std::vector<PoseContext> contexts = health::contexts_of(model, known);
  const CauseEffects effects(model.parts().physics, contexts, model.parts().temperature_mean);
  const WorkingPoses working(effects, health::working_poses(model, contexts.front(), options.seed), options.new_tool);
  Result<CheckRows> rows = health::check_rows(model, known, effects);
  if (!rows) return too_few(known, options, "these poses do not say where the base stands: " + rows.error().message);
  const ErrorFigures& shown = model.parts().training.compensated;
  const int tails = health::tail_freedom_of(shown.rms > 0 ? shown.p997 / shown.rms : 0, model.parts().training.poses);
  HealthCheck check = Examination(options, effects, working, std::move(*rows), tails)
                          .result({model.provenance().measured_at, batch.rows().measured_at});
  check.model = model.provenance().id;
  return check;
}

}  // namespace trammel
