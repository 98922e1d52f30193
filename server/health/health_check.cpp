// A check's residuals are tested for each single cause beside base (and tool), for single bad poses, and as a whole.
// What explains most for its number of parameters (Schwarz's price, log R for each) is taken: a bad pose is refitted
// with the base, a cause is a change, and the rest is tested again. Effects are linear in the cause; of a large one
// kUnlinear may be left over. Zeros of several joints come first, as one explanation of all poses, and are not linear.
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
#include "server/health/evidence/lost_zeros.h"
#include "server/health/evidence/working_poses.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"
#include "server/numerics/chi_square.h"

namespace trammel {

namespace {

using Eigen::Index;
using health::CheckRows;
using health::CheckTests;
using health::Estimate;
using health::HealthyChecks;
using health::Hypothesis;
using health::RefittedRows;
using health::Sifted;
using health::ZerosFit;
using health::ZerosSearch;

constexpr int kMostCauses = 3;          // that a check may name
constexpr int kRounds = 3;              // of looking at each of them again beside the others
constexpr double kAlike = 6;            // of scores: odds of e^3
constexpr double kEven = 1e-3;          // of scores: rounding
constexpr double kCredible = 0.99;      // of all single causes' odds: those that could be it have it together
constexpr double kUnlinear = 0.003;     // of an effect
constexpr double kDoubtful = 0.02;      // chance from which on nothing is said for certain
constexpr double kNearlySeen = 10;      // times the limit: a cause that is named where the whole is beyond chance
constexpr double kZeroGains = 10;       // beyond its price: a zero that is named beside others is so once in 5000
constexpr double kLeastRest = 1e-12;    // of residuals: less is rounding
constexpr double kWorseInstrument = 5;  // times a healthy robot's residuals: an instrument may scatter so
constexpr double kMadeUpFor = 0.01;     // of an effect: so little left of it is not told from what makes up for it
constexpr int kFewestChecks = 3;        // that say how fast an arm drifts
constexpr double kExtrapolated = 10;    // times what the poses are off by: an effect that large is not seen in them
constexpr double kFarOff = kNeverOff;   // m rms, base refitted: no small change, and effects are no longer linear

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

/// How large an effect is, and U(k=2).
struct Size {
  double rms = 0, u95 = 0;
};

/// `2, 4 and 5`, `2 to 5`; joints are 0-based.
std::string joints_in_words(const std::vector<LostZero>& zeros) {
  const int first = zeros.front().joint + 1, last = zeros.back().joint + 1;
  const auto count = static_cast<int>(zeros.size());
  if (count > 2 && last - first + 1 == count) return fmt::format("{} to {}", first, last);
  std::string text = std::to_string(first);
  for (int k = 1; k < count; ++k)
    text += fmt::format("{}{}", k + 1 < count ? ", " : " and ", zeros[static_cast<std::size_t>(k)].joint + 1);
  return text;
}

/// `lost zero in joint 2 (by 0.100 +- 0.002 deg)`, `the zeros of joints 2 and 4: was it remastered? (...)`.
std::string change_in_words(const SeenChange& change) {
  if (change.zeros.empty()) return in_words(change.cause);
  std::vector<std::string> each;
  for (const LostZero& zero : change.zeros)
    each.push_back(fmt::format("{}by {:.3f} +- {:.3f} deg",
                               change.zeros.size() > 1 ? fmt::format("joint {} ", zero.joint + 1) : "", to_deg(zero.by),
                               to_deg(zero.u95)));
  const std::string what =
      change.zeros.size() > 1 ? fmt::format("the zeros of joints {}: was it remastered?", joints_in_words(change.zeros))
                              : in_words(change.cause);
  return fmt::format("{} ({})", what, fmt::join(each, ", "));
}

bool is_zero(const SingleCause& cause) {
  return cause.record == &first_searched_by(causes::SearchFamily::kZeroStep) && !cause.any_function;
}

SingleCause unknown_cause() {
  SingleCause unknown;
  unknown.record = &cause_that_stands_for(causes::StandsFor::kNoKnownCause);
  return unknown;
}

void add_rival(const SingleCause& rival, SeenChange& change) {
  const auto same = [&](const SingleCause& known) { return same_cause(known, rival); };
  const bool known = std::any_of(change.could_also_be.begin(), change.could_also_be.end(), same);
  if (!known && !same(change.cause)) change.could_also_be.push_back(rival);
}

/// An instrument that tells all lengths too long is like an arm that grew, and the tool with it.
void tell_instrument(std::vector<SeenChange>& changed) {
  const auto grew = std::find_if(changed.begin(), changed.end(),
                                 [](const SeenChange& change) { return change.cause.record->needs.temperature; });
  if (grew == changed.end()) return;
  for (const CauseRecord* record : all_causes()) {
    const bool is_rival = std::any_of(record->rivals.begin(), record->rivals.end(), [&](const causes::Rival& rival) {
      return rival.cause == grew->cause.record->spelling;
    });
    if (!is_rival || record->scope != causes::Scope::kSession || record->needs.time) continue;
    for (SeenChange& change : changed) add_rival({record, -1, {}, false}, change);
  }
}

std::string rival_in_words(const SingleCause& cause) {
  return is_zero(cause) && cause.joint < 0 ? "lost zeros in several joints" : in_words(cause);
}

/// One check, while it is looked through.
class Examination {
 public:
  Examination(const HealthOptions& options, const CauseEffects& effects, const WorkingPoses& working, CheckRows rows,
              int tail_freedom, const Chain& robot)
      : options_(options),
        effects_(effects),
        working_(working),
        rows_(std::move(rows)),
        signals_(working.signals(effects, options.seed)),
        questions_(questions()),
        healthy_(rows_, frames_of(rows_), questions_, tail_freedom, options.seed),
        zeros_(effects_, rows_, zeros_of(robot), options.new_tool),
        covariance_(rows_.covariance) {}

  HealthCheck result(const CheckTimes& times) {
    check_.poses = static_cast<int>(rows_.poses());
    check_.tolerance = options_.tolerance;
    check_.not_asked = effects_.not_asked();
    sifted_ = healthy_.sifted(rows_.residual);
    const std::optional<ZerosFit> zeros = lost_zeros(healthy_.tests({}));
    for (const int pose : sifted_.bad) check_.suspects.push_back(rows_.pose_ids[static_cast<std::size_t>(pose)]);
    check_.p_value = healthy_.chance_of(sifted_.smallest_p);
    const CheckTests& tests = healthy_.tests(sifted_.bad);
    if (zeros) {
      tell_zeros(*zeros);
    } else {
      look_for_changes(tests);
    }
    tell_rms(tests.rows());
    tell_smallest(tests);
    tell_due(tests.rows(), times);
    tell_verdict();
    if (!rows_.base_turns())
      check_.sentence +=
          "; poses at one place do not say which way the base is turned: it is taken to be turned as in the model";
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
  [[nodiscard]] Eigen::MatrixXd frames_of(const CheckRows& rows) const {
    if (!options_.new_tool) return rows.by_base;
    return joined(rows.by_base, rows.by_cause(Eigen::all, effects_.tool_columns()));
  }
  /// Causes that are a turning joint's zero, and that base (and tool) do not make up for.
  [[nodiscard]] std::vector<std::size_t> zeros_of(const Chain& robot) const;
  /// Zeros that several joints lost, or one by much, where nothing simpler explains all poses as well and they leave
  /// nothing beyond chance.
  [[nodiscard]] std::optional<ZerosFit> lost_zeros(const CheckTests& tests);
  /// By Schwarz, above no change, which leaves `whole`.
  [[nodiscard]] double score_of(const ZerosFit& fit, double whole) const {
    return whole - fit.left - price(fit.numbers);
  }
  [[nodiscard]] double price(int numbers) const {
    return std::log(static_cast<double>(rows_.residual.size())) * numbers;
  }
  /// True where a single cause, or the bad poses that were found, explain as much for their numbers.
  [[nodiscard]] bool has_simpler(const CheckTests& tests, const Eigen::VectorXd& left, double score);
  void tell_zeros(const ZerosFit& fit);
  void tell_tool_beside(const ZerosFit& fit, const CheckRows& there);
  void tell_other_sets(const ZerosFit& fit, SeenChange& change) const;
  /// Adds the causes that explain as much as this one does beside `others`.
  void tell_rivals_beside(const CheckRows& there, const Eigen::MatrixXd& others, std::size_t cause,
                          SeenChange& change) const;
  /// Several zeros that explain as much as what was named does, with so many `numbers`.
  void tell_several_zeros(double left, int numbers, SeenChange& change) const;
  void look_for_changes(const CheckTests& healthy);
  void tell_what_is_left();
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
  [[nodiscard]] bool may_be_named(std::size_t hypothesis, const CheckTests& tests, const Eigen::VectorXd& left) const;
  /// The likeliest, though its size may be far beyond what these poses show.
  [[nodiscard]] std::size_t most_explained(const CheckTests& tests, const Eigen::VectorXd& left) const;
  /// Refitted besides: all that were named but the one at `k`.
  [[nodiscard]] CheckTests beside_others(std::size_t k) const;
  void refit_named();
  [[nodiscard]] Estimate estimated(std::size_t hypothesis, const RefittedRows& refitted) const;
  /// Over the working poses.
  [[nodiscard]] Size size(std::size_t hypothesis, const Estimate& found) const;
  /// The squared effect of these columns at the check's poses: k x k, m².
  [[nodiscard]] Eigen::MatrixXd square_here(const Eigen::MatrixXd& columns, const RefittedRows& refitted) const;
  /// `over`, or where it is more than the poses are off by, what they show of it.
  void set_size(const Size& over, const Estimate& found, const Eigen::MatrixXd& here, SeenChange& change) const;
  /// Whether it would do far more elsewhere than these poses are off by: they do not show it.
  [[nodiscard]] bool is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const;
  void tell_change(const Named& named, const CheckTests& tests);
  void tell_rivals(std::size_t hypothesis, const CheckTests& tests, const std::vector<double>& scores,
                   SeenChange& change) const;
  [[nodiscard]] std::vector<bool> credible(const std::vector<double>& scores) const;
  /// True where all residuals being larger alike explains as much as the best of all causes does.
  [[nodiscard]] bool is_scatter(std::size_t hypothesis, const CheckTests& tests, const Eigen::VectorXd& left) const;
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
  const ZerosSearch zeros_;
  std::vector<ZerosFit> fits_;  // of `zeros_`, where something is beyond chance
  Sifted sifted_;
  Eigen::MatrixXd covariance_;  // with what a change that was found may leave over
  Eigen::MatrixXd always_;      // refitted: frames and bad poses
  Eigen::MatrixXd nuisance_;    // the same and changes that were found
  std::vector<Named> named_;
  double off_ = 0;           // m rms of the positions
  bool is_far_ = false;      // only a tool that sits elsewhere is named
  bool is_too_far_ = false;  // nothing is
  double scatter_ = 0;       // times a healthy robot's residuals, where nothing explains them better than noise
  HealthCheck check_;
};

/// The size of an effect of numbers w whose square is w' `square` w.
Size size_of(const Estimate& found, const Eigen::MatrixXd& square) {
  const double whole = found.numbers.dot(square * found.numbers);
  const double by_noise = (square * found.covariance).trace();
  const Eigen::VectorXd gradient = square * found.numbers / std::max(std::sqrt(whole), 1e-12);
  return {std::sqrt(std::max(whole - by_noise, 0.0)), 2 * std::sqrt(gradient.dot(found.covariance * gradient))};
}

/// The size where a joint's angle is off by anything at each pose; `rms`: if it is one prior scale everywhere.
Size size_of_any(const Estimate& found, double rms) {
  const auto poses = static_cast<double>(found.numbers.size());
  const double by_noise = found.covariance.trace() / poses;
  const double square = std::max(found.numbers.squaredNorm() / poses - by_noise, 0.0);
  return {rms * std::sqrt(square), 2 * rms * std::sqrt(by_noise / 2)};
}

void Examination::look_for_changes(const CheckTests& healthy) {
  always_ = frames_of(rows_);
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
  if (!named_.empty()) tell_what_is_left();
}

/// Adds to each change that several zeros explain as much, and that something is left beside all of them.
void Examination::tell_what_is_left() {
  const CheckTests tests(covariance_, nuisance_, questions_);
  const bool is_all = tests.smallest_p(tests.rows().left(rows_.residual)) >= healthy_.limit(options_.false_alarm);
  const RefittedRows named(rows_.covariance, nuisance_);
  const double left = named.left(rows_.residual).squaredNorm();
  const int numbers = RefittedRows(rows_.covariance, always_).freedom() - named.freedom();
  tell_instrument(check_.changed);
  for (SeenChange& change : check_.changed) {
    tell_several_zeros(left, numbers, change);
    if (!is_all) add_rival(unknown_cause(), change);
  }
}

void Examination::tell_several_zeros(double left, int numbers, SeenChange& change) const {
  const auto is_in = [&](const Named& named, const ZerosFit& fit) {
    const std::size_t cause = questions_.hypotheses[named.hypothesis].cause;
    if (is_tool(named.hypothesis)) return fit.tool;
    return std::find(fit.zeros.begin(), fit.zeros.end(), cause) != fit.zeros.end();
  };
  for (const ZerosFit& fit : fits_) {
    const bool is_more_of_it =
        std::all_of(named_.begin(), named_.end(), [&](const Named& named) { return is_in(named, fit); });
    const bool is_likelier = fit.left + price(fit.numbers) < left + price(numbers);
    if (fit.zeros.empty() || (is_more_of_it ? !is_likelier : fit.left > left + kAlike)) continue;
    SingleCause zeros = effects_.causes()[fit.zeros.front()].cause;
    if (fit.zeros.size() > 1) zeros.joint = -1;
    add_rival(zeros, change);
  }
}

std::vector<std::size_t> Examination::zeros_of(const Chain& robot) const {
  std::vector<std::size_t> zeros;
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const SingleCause& cause = effects_.causes()[questions_.hypotheses[h].cause].cause;
    if (is_zero(cause) && robot.joint(cause.joint).type == JointType::kRevolute)
      zeros.push_back(questions_.hypotheses[h].cause);
  }
  return zeros;
}

std::optional<ZerosFit> Examination::lost_zeros(const CheckTests& tests) {
  constexpr int kFewestLeft = 3;  // numbers that can speak against it
  const Eigen::VectorXd left = tests.rows().left(rows_.residual);
  const double limit = healthy_.limit(options_.false_alarm);
  const double smallest = tests.smallest_p(left);
  off_ = distance_of(tests.rows());
  if (smallest >= limit) return std::nullopt;
  fits_ = zeros_.all();
  if (fits_.empty()) return std::nullopt;
  const auto cost = [&](const ZerosFit& fit) {
    return fit.left + price(fit.numbers) + kZeroGains * (static_cast<double>(fit.zeros.size()) + (fit.tool ? 1 : 0));
  };
  const ZerosFit& best = *std::min_element(fits_.begin(), fits_.end(),
                                           [&](const ZerosFit& a, const ZerosFit& b) { return cost(a) < cost(b); });
  const bool is_one_linear = best.zeros.size() == 1 && !best.tool && off_ < kFarOff;
  const int freedom = tests.rows().freedom() - best.numbers;
  if (best.zeros.empty() || is_one_linear || freedom < kFewestLeft || chi_square_tail(best.left, freedom) < limit)
    return std::nullopt;
  if (has_simpler(tests, left, score_of(best, left.squaredNorm()))) return std::nullopt;
  sifted_ = {{}, smallest};
  return best;
}

bool Examination::has_simpler(const CheckTests& tests, const Eigen::VectorXd& left, double score) {
  const std::vector<double> scores = tests.scores(left);
  for (std::size_t h = 0; h < scores.size(); ++h) {
    const bool is_flexible =
        h < questions_.causes && effects_.causes()[questions_.hypotheses[h].cause].cause.any_function;
    if (scores[h] > score + (is_flexible ? kAlike : 0)) return true;
  }
  const RefittedRows& without_bad = healthy_.tests(sifted_.bad).rows();
  const double by_bad = left.squaredNorm() - without_bad.left(rows_.residual).squaredNorm();
  return by_bad - price(tests.rows().freedom() - without_bad.freedom()) > score;
}

void Examination::tell_zeros(const ZerosFit& fit) {
  const CheckRows there = zeros_.around(fit);
  const auto count = static_cast<Index>(fit.zeros.size());
  const std::vector<Index> columns(fit.columns.begin(), fit.columns.begin() + count);
  const Estimate found{fit.at(columns), fit.covariance.topLeftCorner(count, count)};
  SeenChange change;
  change.cause = effects_.causes()[fit.zeros.front()].cause;
  change.p_value = check_.p_value;
  for (Index k = 0; k < count; ++k) {
    const double scale = effects_.scale(columns[static_cast<std::size_t>(k)]);
    change.zeros.push_back({effects_.causes()[fit.zeros[static_cast<std::size_t>(k)]].cause.joint,
                            scale * found.numbers(k), 2 * scale * std::sqrt(found.covariance(k, k))});
  }
  if (count > 1) change.cause.joint = -1;
  set_size(size_of(found, working_.left_square(columns)), found,
           square_here(there.by_cause(Eigen::all, columns), RefittedRows(rows_.covariance, frames_of(there))), change);
  tell_other_sets(fit, change);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    std::vector<Index> others = fit.columns;
    std::erase(others, columns[k]);
    tell_rivals_beside(there, joined(frames_of(there), there.by_cause(Eigen::all, others)), fit.zeros[k], change);
  }
  check_.changed.push_back(std::move(change));
  if (fit.tool) tell_tool_beside(fit, there);
}

/// The tool of `fit`, and zeros that it makes up for.
void Examination::tell_tool_beside(const ZerosFit& fit, const CheckRows& there) {
  const auto& columns = effects_.tool_columns();
  const auto count = static_cast<Index>(columns.size());
  const std::vector<Index> zeros(fit.columns.begin(), fit.columns.end() - count);
  const Estimate found{fit.at(columns), fit.covariance.bottomRightCorner(count, count)};
  const auto& causes = effects_.causes();
  const auto tool = std::find_if(causes.begin(), causes.end(),
                                 [&](const CauseEffects::Entry& entry) { return entry.columns == columns; });
  SeenChange change;
  change.cause = tool->cause;
  change.p_value = check_.p_value;
  const RefittedRows beside_base(rows_.covariance, frames_of(there));
  set_size(size_of(found, working_.left_square(columns)), found,
           square_here(there.by_cause(Eigen::all, columns), beside_base), change);
  tell_rivals_beside(there, joined(frames_of(there), there.by_cause(Eigen::all, zeros)),
                     static_cast<std::size_t>(tool - causes.begin()), change);
  const RefittedRows beside_all(rows_.covariance, joined(frames_of(there), there.by_cause(Eigen::all, fit.columns)));
  for (const Hypothesis& one : questions_.hypotheses) {
    const CauseEffects::Entry& entry = causes[one.cause];
    const bool is_named = std::find(fit.zeros.begin(), fit.zeros.end(), one.cause) != fit.zeros.end();
    if (one.pose >= 0 || is_named || !is_zero(entry.cause)) continue;
    const Eigen::MatrixXd own = there.by_cause.col(entry.columns.front());
    if (beside_all.left(own).norm() < kMadeUpFor * beside_base.left(own).norm()) add_rival(entry.cause, change);
  }
  check_.changed.push_back(std::move(change));
}

void Examination::tell_other_sets(const ZerosFit& fit, SeenChange& change) const {
  const double whole = 0;  // of all alike
  for (const ZerosFit& other : fits_) {
    const bool is_more = std::includes(other.zeros.begin(), other.zeros.end(), fit.zeros.begin(), fit.zeros.end()) &&
                         (other.tool || !fit.tool);
    const double ahead = score_of(other, whole) - score_of(fit, whole);
    const bool as_likely = ahead > (is_more ? 0 : -kAlike);
    const bool as_much = !is_more && other.zeros.size() <= fit.zeros.size() && other.left < fit.left + kAlike;
    if (!as_likely && !as_much) continue;
    for (const std::size_t zero : other.zeros) {
      const bool is_named = std::find(fit.zeros.begin(), fit.zeros.end(), zero) != fit.zeros.end();
      if (!is_named) add_rival(effects_.causes()[zero].cause, change);
    }
    for (const CauseEffects::Entry& entry : effects_.causes())
      if (other.tool && !fit.tool && entry.columns == effects_.tool_columns()) add_rival(entry.cause, change);
  }
}

void Examination::tell_rivals_beside(const CheckRows& there, const Eigen::MatrixXd& others, std::size_t cause,
                                     SeenChange& change) const {
  const health::Questions questions{health::cause_hypotheses(effects_, there, signals_), questions_.causes};
  const CheckTests tests(rows_.covariance, others, questions);
  const auto own = std::find_if(questions.hypotheses.begin(), questions.hypotheses.end(),
                                [&](const Hypothesis& one) { return one.cause == cause; });
  if (own == questions.hypotheses.end()) return;
  tell_rivals(static_cast<std::size_t>(own - questions.hypotheses.begin()), tests,
              tests.scores(tests.rows().left(there.residual)), change);
}

bool Examination::look_once(const CheckTests& tests) {
  const Eigen::VectorXd left = tests.rows().left(rows_.residual);
  const double smallest = tests.smallest_p(left);
  const double limit = healthy_.limit(options_.false_alarm);
  if (smallest >= limit) return false;
  const double chance = healthy_.chance_of(smallest);
  const std::optional<std::size_t> best = likeliest(tests, left);
  const auto is_all_of_it = [&](std::size_t cause) {
    const RefittedRows without(covariance_, joined(nuisance_, questions_.hypotheses[cause].columns));
    return distance_of(without) < kFarOff;
  };
  if (is_far_ && !(best && is_tool(*best) && is_all_of_it(*best))) {
    is_too_far_ = true;
    return false;
  }
  const auto is_seen = [&](std::size_t cause) { return tests.p_value(cause, left) < kNearlySeen * limit; };
  const bool fits = best && is_seen(*best) && !is_scatter(*best, tests, left);
  if (fits) {
    named_.push_back({*best, chance});
    refit_named();
  } else if (named_.empty() && questions_.causes > 0) {
    const std::size_t most = most_explained(tests, left);
    const double scatter = std::sqrt(left.squaredNorm() / tests.rows().freedom());
    if (is_scatter(most, tests, left) && scatter < kWorseInstrument) {
      scatter_ = scatter;
    } else if (tests.whole_p(left) < limit || is_seen(most)) {
      unknown_found(chance, left, tests.rows().freedom());
    }
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
  // Where a joint stays at one angle, anything over that angle acts like its zero, which is simpler.
  for (std::size_t h = 0; h < scores.size(); ++h)
    if (is_zero(effects_.causes()[questions_.hypotheses[h].cause].cause)) scores[h] += kEven;
  while (!scores.empty()) {
    const auto best = std::max_element(scores.begin(), scores.end());
    const auto hypothesis = static_cast<std::size_t>(best - scores.begin());
    if (*best <= 0) return std::nullopt;
    if (!is_extrapolated(hypothesis, tests.rows()) && may_be_named(hypothesis, tests, left)) return hypothesis;
    *best = 0;
  }
  return std::nullopt;
}

bool Examination::is_scatter(std::size_t hypothesis, const CheckTests& tests, const Eigen::VectorXd& left) const {
  const double whole = left.squaredNorm();
  const double rest = whole - (tests.directions()[hypothesis].transpose() * left).squaredNorm();
  const double gained = tests.rows().freedom() * std::log(whole / std::max(rest, kLeastRest * whole));
  return gained < price(tests.freedom(hypothesis)) + 2 * std::log(static_cast<double>(questions_.causes));
}

/// A cause of any form fits nearly anything in part, so it is named only where nothing is left.
bool Examination::may_be_named(std::size_t hypothesis, const CheckTests& tests, const Eigen::VectorXd& left) const {
  if (!effects_.causes()[questions_.hypotheses[hypothesis].cause].cause.any_function) return true;
  const int freedom = tests.rows().freedom() - tests.freedom(hypothesis);
  const double rest = left.squaredNorm() - (tests.directions()[hypothesis].transpose() * left).squaredNorm();
  return freedom > 0 && chi_square_tail(rest, freedom) >= healthy_.limit(options_.false_alarm);
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
    const Estimate found = estimated(named_[k].hypothesis, RefittedRows(rows_.covariance, nuisance_));
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

double Examination::distance_of(const RefittedRows& refitted) const {
  const Eigen::VectorXd left = refitted.unwhitened(refitted.left(rows_.residual));
  double square = 0;
  for (const Index first : rows_.first) square += left.segment<3>(first).squaredNorm();
  return std::sqrt(square / static_cast<double>(rows_.poses()));
}

bool Examination::is_tool(std::size_t hypothesis) const {
  return effects_.causes()[questions_.hypotheses[hypothesis].cause].columns == effects_.tool_columns();
}

Estimate Examination::estimated(std::size_t hypothesis, const RefittedRows& refitted) const {
  const Hypothesis& one = questions_.hypotheses[hypothesis];
  const SingleCause& cause = effects_.causes()[one.cause].cause;
  const double widest = cause.any_function ? health::kWidestFunction
                        : is_zero(cause)   ? health::kWidestZero
                                           : health::kWidest;
  return health::estimate(refitted.left(one.columns), refitted.left(rows_.residual), widest);
}

Size Examination::size(std::size_t hypothesis, const Estimate& found) const {
  const CauseEffects::Entry& entry = effects_.causes()[questions_.hypotheses[hypothesis].cause];
  return entry.cause.any_function ? size_of_any(found, working_.any_function_rms(entry.columns.front()))
                                  : size_of(found, working_.left_square(entry.columns));
}

Eigen::MatrixXd Examination::square_here(const Eigen::MatrixXd& columns, const RefittedRows& refitted) const {
  const Eigen::MatrixXd all = refitted.unwhitened(refitted.left(columns));
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
  for (const Index first : rows_.first) square += all.middleRows<3>(first).transpose() * all.middleRows<3>(first);
  return square / static_cast<double>(rows_.poses());
}

void Examination::set_size(const Size& over, const Estimate& found, const Eigen::MatrixXd& here,
                           SeenChange& change) const {
  change.at_these_poses = over.rms > off_;
  const Size told = change.at_these_poses ? size_of(found, here) : over;
  change.effect_rms = std::min(told.rms, off_);
  change.u95 = told.u95;
}

bool Examination::is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const {
  return size(hypothesis, estimated(hypothesis, refitted)).rms > kExtrapolated * off_;
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
  if (std::find(zeros_.causes().begin(), zeros_.causes().end(), one.cause) != zeros_.causes().end())
    change.zeros.push_back(
        {entry.cause.joint, scale * found.numbers(0), 2 * scale * std::sqrt(found.covariance(0, 0))});
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
  const auto explained = [&](std::size_t h) { return scores[h] + price(tests.freedom(h)); };
  const std::vector<bool> likely = credible(scores);
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const SingleCause& other = effects_.causes()[questions_.hypotheses[h].cause].cause;
    const bool as_much = !other.any_function && explained(h) > explained(hypothesis) - kAlike;
    if (h != hypothesis && (as_much || likely[h] || scores[h] > scores[hypothesis] - kAlike)) add_rival(other, change);
  }
  if (!change.cause.any_function) return;
  for (const causes::Rival& rival : change.cause.record->rivals) {
    const CauseRecord* record = find_cause(rival.cause);
    if (record != nullptr && record->scope == causes::Scope::kJoint)
      add_rival({record, change.cause.joint, {}, false}, change);
  }
}

void Examination::unknown_found(double chance, const Eigen::VectorXd& left, int freedom) {
  SeenChange change;
  change.cause = unknown_cause();
  change.p_value = chance;
  change.at_these_poses = true;
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
  if (rate.checks < kFewestChecks) {
    check_.due_because = fmt::format(
        "{}; a date needs {} checks of different days, so far there {} {}: until then check at the usual interval",
        because_of(rate, static_cast<double>(*times.check - *times.model)), kFewestChecks,
        rate.checks > 1 ? "are" : "is", rate.checks);
    return;
  }
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
    text += fmt::format("{}{}: {:.3f} +- {:.3f} mm rms {}", text.empty() ? "" : "; ", change_in_words(change),
                        to_mm(change.effect_rms), to_mm(change.u95),
                        change.at_these_poses ? "at these poses" : "over the working poses");
    for (const SingleCause& other : change.could_also_be) text += ", or " + rival_in_words(other);
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
    const bool is_sure = std::all_of(check_.changed.begin(), check_.changed.end(), [](const SeenChange& change) {
      return change.could_also_be.empty() && change.cause.record != unknown_cause().record;
    });
    if (!is_sure)
      check_.sentence += fmt::format("; `trammel plan --check {}` chooses poses that tell more", 2 * check_.poses);
  } else if (scatter_ > 0) {
    check_.sentence = fmt::format(
        "the poses are off by {:.1f} times as much as a healthy robot's, and no change explains that better than noise "
        "does: the instrument measured worse than its sigma says, or several things changed; measure again, or more "
        "poses (`trammel plan --check {}`)",
        scatter_, 2 * check_.poses);
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

/// True where lost zeros are named, and leave nothing beyond chance.
bool is_all_by_zeros(const HealthCheck& check) {
  const auto leaves_nothing = [](const SeenChange& change) {
    const auto& others = change.could_also_be;
    return std::none_of(others.begin(), others.end(),
                        [](const SingleCause& other) { return same_cause(other, unknown_cause()); });
  };
  return !check.changed.empty() && !check.changed.front().zeros.empty() &&
         std::all_of(check.changed.begin(), check.changed.end(), leaves_nothing);
}

Result<HealthCheck> looked_through(const CompensatedModel& model, const CheckedBatch& batch,
                                   const HealthOptions& options) {
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
  HealthCheck check = Examination(options, effects, working, std::move(*rows), tails, model.cell().robot)
                          .result({model.provenance().measured_at, batch.rows().measured_at});
  check.model = model.provenance().id;
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
  Result<HealthCheck> check = looked_through(model, batch, options);
  if (check && is_all_by_zeros(*check)) return check;
  if (std::optional<Error> doubt = reading_doubt(batch.rows(), model.cell()))
    return tl::make_unexpected(std::move(*doubt));
  return check;
}

}  // namespace trammel
