// Zeros that several joints lost, as one explanation of all poses.
#include <algorithm>
#include <cmath>

#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"
#include "server/numerics/chi_square.h"

namespace trammel::health {

using Eigen::Index;

namespace {

constexpr double kZeroGains = 10;    // beyond its price: by chance a zero reaches this once in 5000
constexpr double kMadeUpFor = 0.01;  // of an effect: with less left, it cannot be distinguished
                                     // from the effects that absorb it
constexpr std::size_t kMostBadBeside = 2,
                      kPosesToOneBad = 6;  // bad poses that are looked for beside zeros

}  // namespace

void Examination::tell_several_zeros(double left, int numbers, SeenChange& change) const {
  const auto is_in = [&](const Named& named, const ZerosFit& fit) {
    const std::size_t cause = questions_.hypotheses[named.hypothesis].cause;
    if (is_tool(named.hypothesis)) return fit.tool;
    return std::find(fit.zeros.begin(), fit.zeros.end(), cause) != fit.zeros.end();
  };
  for (const ZerosFit& fit : fits_) {
    const bool is_more_of_it = std::all_of(named_.begin(), named_.end(),
                                           [&](const Named& named) { return is_in(named, fit); });
    const bool is_likelier = fit.left + price(fit.numbers) < left + price(numbers);
    if (fit.zeros.empty() || (is_more_of_it ? !is_likelier : fit.left > left + kAlike)) continue;
    SingleCause zeros = effects_.causes()[fit.zeros.front()].cause;
    if (fit.zeros.size() > 1) zeros.joint = -1;
    add_rival(zeros, change);
  }
}

Eigen::MatrixXd Examination::always_at(const CheckRows& there) const {
  Eigen::MatrixXd always = frames_of(there);
  for (const int pose : sifted_.bad)
    always = joined(
        always, questions_.hypotheses[questions_.causes + static_cast<std::size_t>(pose)].columns);
  return always;
}

std::optional<ZerosFit> Examination::lost_zeros() {
  const CheckTests& tests = healthy_.tests({});
  off_ = distance_of(tests.rows());
  if (tests.smallest_p(tests.rows().left(rows_.residual)) >= healthy_.limit(options_.false_alarm))
    return std::nullopt;
  fits_ = zeros_.all();
  if (fits_.empty()) return std::nullopt;
  if (auto found = likeliest_zeros({})) return found;
  const std::vector<ZerosFit> of_all_poses = fits_;
  std::vector<int> bad;
  while (bad.size() < kMostBadBeside && kPosesToOneBad * (bad.size() + 1) <= rows_.poses()) {
    const std::optional<int> pose = pose_that_fits_no_zeros(bad);
    if (!pose) break;
    bad.push_back(*pose);
    fits_ = zeros_.all(bad);
    if (auto found = likeliest_zeros(bad)) return found;
  }
  fits_ = of_all_poses;
  return std::nullopt;
}

std::optional<ZerosFit> Examination::likeliest_zeros(const std::vector<int>& bad) {
  constexpr int kFewestLeft = 3;  // fewest numbers that can contradict it
  const double limit = healthy_.limit(options_.false_alarm);
  const auto cost = [&](const ZerosFit& fit) {
    return fit.left + price(fit.numbers) +
           kZeroGains * (static_cast<double>(fit.zeros.size()) + (fit.tool ? 1 : 0));
  };
  const ZerosFit& best =
      *std::min_element(fits_.begin(), fits_.end(),
                        [&](const ZerosFit& a, const ZerosFit& b) { return cost(a) < cost(b); });
  const CheckTests& tests = healthy_.tests(bad);
  const CheckTests& of_all = healthy_.tests({});
  const Eigen::VectorXd left = tests.rows().left(rows_.residual),
                        all_left = of_all.rows().left(rows_.residual);
  const double off = distance_of(tests.rows());
  // To first order, a zero of a degree leaves a residual that another cause then explains.
  const auto is_linear = [&](std::size_t zero) {
    for (std::size_t h = 0; h < questions_.causes; ++h)
      if (questions_.hypotheses[h].cause == zero)
        return left.squaredNorm() - (tests.directions()[h].transpose() * left).squaredNorm() <
               best.left + kAlike;
    return true;
  };
  const bool is_one_linear =
      best.zeros.size() == 1 && !best.tool && off < kFarOff && is_linear(best.zeros.front());
  const int freedom = tests.rows().freedom() - best.numbers;
  if (best.zeros.empty() || is_one_linear || freedom < kFewestLeft ||
      chi_square_tail(best.left, freedom) < limit)
    return std::nullopt;
  const double of_bad = price(of_all.rows().freedom() - tests.rows().freedom());
  const double score = score_of(best, all_left.squaredNorm()) - of_bad;
  if (has_simpler(of_all, score) || are_bad_poses(score)) return std::nullopt;
  if (!bad.empty() && has_simpler(tests, score_of(best, left.squaredNorm()))) return std::nullopt;
  sifted_ = {bad, of_all.smallest_p(all_left)};
  off_ = off;
  return best;
}

std::optional<int> Examination::pose_that_fits_no_zeros(const std::vector<int>& bad) const {
  const CheckRows there = zeros_.around(fits_.back());
  Eigen::MatrixXd refitted =
      joined(frames_of(there), there.by_cause(Eigen::all, fits_.back().columns));
  for (const int pose : bad)
    refitted =
        joined(refitted,
               questions_.hypotheses[questions_.causes + static_cast<std::size_t>(pose)].columns);
  const RefittedRows beside(rows_.covariance, refitted);
  const Eigen::VectorXd left = beside.left(there.residual);
  std::optional<int> worst;
  double most = 0;
  for (std::size_t h = questions_.causes; h < questions_.hypotheses.size(); ++h) {
    const Eigen::MatrixXd own = beside.directions(questions_.hypotheses[h].columns);
    const double score =
        (own.transpose() * left).squaredNorm() - price(static_cast<int>(own.cols()));
    if (score <= most) continue;
    most = score;
    worst = questions_.hypotheses[h].pose;
  }
  return worst;
}

bool Examination::has_simpler(const CheckTests& tests, double score) const {
  const std::vector<double> scores = tests.scores(tests.rows().left(rows_.residual));
  for (std::size_t h = 0; h < scores.size(); ++h) {
    const bool is_flexible = h < questions_.causes &&
                             effects_.causes()[questions_.hypotheses[h].cause].cause.any_function;
    if (scores[h] > score + (is_flexible ? kAlike : 0)) return true;
  }
  return false;
}

bool Examination::are_bad_poses(double score) {
  const CheckTests& tests = healthy_.tests({});
  const RefittedRows& without_bad = healthy_.tests(sifted_.bad).rows();
  const double by_bad = tests.rows().left(rows_.residual).squaredNorm() -
                        without_bad.left(rows_.residual).squaredNorm();
  return by_bad - price(tests.rows().freedom() - without_bad.freedom()) > score;
}

void Examination::tell_zeros(const ZerosFit& fit) {
  const CheckRows there = zeros_.around(fit);
  const auto count = static_cast<Index>(fit.zeros.size());
  const std::vector<Index> columns(fit.columns.begin(), fit.columns.begin() + count);
  const Estimate found{fit.at(columns), fit.covariance.topLeftCorner(count, count)};
  const Eigen::MatrixXd over = working_.left_square(columns),
                        here = square_here(there.by_cause(Eigen::all, columns),
                                           RefittedRows(rows_.covariance, always_at(there)));
  SeenChange change;
  change.cause = effects_.causes()[fit.zeros.front()].cause;
  change.p_value = check_.p_value;
  set_size(size_of(found, over), found, here, change);
  for (Index k = 0; k < count; ++k) {
    const auto zero = static_cast<std::size_t>(k);
    const double scale = effects_.scale(columns[zero]);
    const Size alone = size_of({found.numbers.segment(k, 1), found.covariance.block(k, k, 1, 1)},
                               (change.at_these_poses ? here : over).block(k, k, 1, 1));
    change.zeros.push_back({effects_.causes()[fit.zeros[zero]].cause.joint,
                            scale * found.numbers(k), 2 * scale * std::sqrt(found.covariance(k, k)),
                            alone.rms, alone.u95});
  }
  if (count > 1) change.cause.joint = -1;
  tell_other_sets(fit, change);
  for (std::size_t k = 0; k < columns.size(); ++k) {
    std::vector<Index> others = fit.columns;
    std::erase(others, columns[k]);
    tell_rivals_beside(there, joined(always_at(there), there.by_cause(Eigen::all, others)),
                       fit.zeros[k], change);
  }
  check_.changed.push_back(std::move(change));
  if (fit.tool) tell_tool_beside(fit, there);
}

/// The tool of `fit`, and zeros that it compensates.
void Examination::tell_tool_beside(const ZerosFit& fit, const CheckRows& there) {
  const auto& columns = effects_.tool_columns();
  const auto count = static_cast<Index>(columns.size());
  const std::vector<Index> zeros(fit.columns.begin(), fit.columns.end() - count);
  const Estimate found{fit.at(columns), fit.covariance.bottomRightCorner(count, count)};
  const auto& causes = effects_.causes();
  const auto tool =
      std::find_if(causes.begin(), causes.end(),
                   [&](const CauseEffects::Entry& entry) { return entry.columns == columns; });
  SeenChange change;
  change.cause = tool->cause;
  change.p_value = check_.p_value;
  const RefittedRows beside_base(rows_.covariance, always_at(there));
  set_size(size_of(found, working_.left_square(columns)), found,
           square_here(there.by_cause(Eigen::all, columns), beside_base), change);
  tell_rivals_beside(there, joined(always_at(there), there.by_cause(Eigen::all, zeros)),
                     static_cast<std::size_t>(tool - causes.begin()), change);
  tell_zeros_in_tool(there, joined(always_at(there), there.by_cause(Eigen::all, zeros)), fit.zeros,
                     change);
  check_.changed.push_back(std::move(change));
}

void Examination::tell_zeros_in_tool(const CheckRows& there, const Eigen::MatrixXd& others,
                                     const std::vector<std::size_t>& named, SeenChange& change) {
  const RefittedRows beside_frames(rows_.covariance, always_at(there));
  const RefittedRows beside_tool(
      rows_.covariance, joined(others, there.by_cause(Eigen::all, effects_.tool_columns())));
  for (const Hypothesis& one : questions_.hypotheses) {
    if (one.pose >= 0 || std::find(named.begin(), named.end(), one.cause) != named.end()) continue;
    const CauseEffects::Entry& entry = effects_.causes()[one.cause];
    if (!is_zero(entry.cause)) continue;
    const Eigen::MatrixXd own = there.by_cause.col(entry.columns.front());
    const double least = kMadeUpFor * beside_frames.left(own).norm();
    if (beside_tool.left(own).norm() >= least || has_not_turned(there, others, one.cause, change))
      continue;
    add_rival(entry.cause, change);
    doubt_.in_tool.push_back(entry.cause.joint);
  }
}

bool Examination::has_not_turned(const CheckRows& there, const Eigen::MatrixXd& others,
                                 std::size_t zero, const SeenChange& tool) const {
  constexpr int kShifts = 3;       // the first numbers of a tool
  constexpr double kHidden = 0.2;  // share of the tool's effect: a zero with less does not change
                                   // the name
  const std::vector<Index> column = effects_.causes()[zero].columns;
  const std::vector<Index> shifts(effects_.tool_columns().begin(),
                                  effects_.tool_columns().begin() + kShifts);
  const Eigen::MatrixXd own = there.by_cause(Eigen::all, column);
  const RefittedRows beside_frames(rows_.covariance, always_at(there));
  const RefittedRows beside_shift(rows_.covariance,
                                  joined(others, there.by_cause(Eigen::all, shifts)));
  const Eigen::MatrixXd turns = beside_shift.left(own);
  if (turns.norm() < kMadeUpFor * beside_frames.left(own).norm()) return false;
  const Estimate turned = estimate(turns, beside_shift.left(there.residual), kWidestZero);
  const double gained = turned.numbers(0) * turned.numbers(0) / turned.covariance(0, 0);
  const double most = std::abs(turned.numbers(0)) + 2 * std::sqrt(turned.covariance(0, 0));
  const Eigen::MatrixXd square =
      tool.at_these_poses ? square_here(own, beside_frames) : working_.left_square(column);
  const double hidden = most * std::sqrt(square(0, 0));
  return gained < kAlike && hidden < std::min(kHidden * tool.effect_rms, options_.tolerance);
}

void Examination::tell_other_sets(const ZerosFit& fit, SeenChange& change) const {
  const double whole = 0;  // of all alike
  for (const ZerosFit& other : fits_) {
    const bool is_more =
        std::includes(other.zeros.begin(), other.zeros.end(), fit.zeros.begin(), fit.zeros.end()) &&
        (other.tool || !fit.tool);
    const double ahead = score_of(other, whole) - score_of(fit, whole);
    const bool as_likely = ahead > (is_more ? 0 : -kAlike);
    const bool as_much =
        !is_more && other.zeros.size() <= fit.zeros.size() && other.left < fit.left + kAlike;
    if (!as_likely && !as_much) continue;
    for (const std::size_t zero : other.zeros) {
      const bool is_named = std::find(fit.zeros.begin(), fit.zeros.end(), zero) != fit.zeros.end();
      if (!is_named) add_rival(effects_.causes()[zero].cause, change);
    }
    for (const CauseEffects::Entry& entry : effects_.causes())
      if (other.tool && !fit.tool && entry.columns == effects_.tool_columns())
        add_rival(entry.cause, change);
  }
}

}  // namespace trammel::health
