// The rivals that explain the poses as well as the named cause.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"

namespace trammel::health {

namespace {

constexpr double kCredible =
    0.99;  // of all single causes' odds: the candidates together have this share

}  // namespace

void Examination::tell_rivals_beside(const CheckRows& there, const Eigen::MatrixXd& others,
                                     std::size_t cause, SeenChange& change) const {
  const Questions questions{cause_hypotheses(effects_, there, signals_), questions_.causes};
  const CheckTests tests(rows_.covariance, others, questions);
  const auto own = std::find_if(questions.hypotheses.begin(), questions.hypotheses.end(),
                                [&](const Hypothesis& one) { return one.cause == cause; });
  if (own == questions.hypotheses.end()) return;
  tell_rivals(static_cast<std::size_t>(own - questions.hypotheses.begin()), tests,
              tests.scores(tests.rows().left(there.residual)), change);
}

/// The most likely single causes with kCredible of the odds in total. The true cause may be among
/// many unlikely ones.
std::vector<bool> Examination::credible(const std::vector<double>& scores) const {
  std::vector<std::size_t> order(questions_.causes);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
  const auto odds = [&](std::size_t h) {
    return std::exp(0.5 * (scores[h] - scores[order.front()]));
  };
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

void Examination::tell_rivals(std::size_t hypothesis, const CheckTests& tests,
                              const std::vector<double>& scores, SeenChange& change) const {
  // The gain of a cause without the price of its numbers, since a cause with more numbers may still
  // be the true one.
  const auto explained = [&](std::size_t h) { return scores[h] + price(tests.freedom(h)); };
  const std::vector<bool> likely = credible(scores);
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const SingleCause& other = effects_.causes()[questions_.hypotheses[h].cause].cause;
    const bool as_much = !other.any_function && explained(h) > explained(hypothesis) - kAlike;
    if (h != hypothesis && (as_much || likely[h] || scores[h] > scores[hypothesis] - kAlike))
      add_rival(other, change);
  }
  if (!change.cause.any_function) return;
  for (const causes::Rival& rival : change.cause.record->rivals) {
    const CauseRecord* record = find_cause(rival.cause);
    if (record != nullptr && record->scope == causes::Scope::kJoint)
      add_rival({record, change.cause.joint, {}, false}, change);
  }
}

}  // namespace trammel::health
