// Zeros that several joints lost, as one explanation of all poses.
#include <algorithm>
#include <cmath>

#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"
#include "server/numerics/chi_square.h"

namespace trammel::health {

using Eigen::Index;

namespace {

constexpr double kZeroGains = 10;    // beyond its price: a zero that is named beside others is so once in 5000
constexpr double kMadeUpFor = 0.01;  // of an effect: so little left of it is not told from what makes up for it

}  // namespace

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

}  // namespace trammel::health
