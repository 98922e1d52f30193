#include "server/diagnose/search/whole_list.h"

#include <algorithm>

#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/held_out.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

struct Trial {
  Cause cause;
  PriorModel model;
  double square = 0;
};

/// The causes that always act, by their own parameters: of the whole arm or cell, and `of_joints`
/// as well.
std::vector<Cause> causes_to_try(const SearchResult& result, bool of_joints) {
  std::vector<Cause> all;
  for (const std::string& source :
       candidate_sources(*result.after.model.cell, result.batch, nullptr)) {
    const CauseRecord& record = cause_spelled(source);
    const bool of_joint = record.scope == causes::Scope::kJoint;
    const bool is_open =
        record.scope == causes::Scope::kArm || record.scope == causes::Scope::kCell;
    if (record.lasting != causes::Lasting::kAlways ||
        record.search != causes::SearchFamily::kColumns)
      continue;
    if (is_open || (of_joint && of_joints))
      all.push_back(
          cause_at(record, of_joint ? std::stoi(source.substr(source.find(':') + 1)) - 1 : -1));
  }
  return all;
}

/// True if positions leave more than noise.
bool leaves_much(const SearchResult& result) {
  const LinearProblem problem(result.after.model, result.batch, result.after.priors, {});
  return problem.noise() > thresholds::kLeavesMuch * problem.instrument();
}

std::vector<Trial> trials_of(const SearchResult& result, const std::vector<Cause>& closed,
                             const Eigen::VectorXd& weight) {
  std::vector<Trial> trials;
  for (const Cause& cause : causes_to_try(result, result.unnamed.empty())) {
    const bool tried = std::find(closed.begin(), closed.end(), cause) != closed.end();
    Trial trial{cause, result.after, 0};
    if (tried || has_cause(trial.model.model, cause) || !add_to(trial.model, to_string(cause)))
      continue;
    refine(trial.model, result.batch, {}, Weighed::kAsStated);
    refine(trial.model, result.batch, {});
    trial.square = held_out_square(trial.model, result.batch, {}, weight);
    trials.push_back(std::move(trial));
  }
  return trials;
}

}  // namespace

std::optional<NamedInstead> named_instead_of_functions(const SearchResult& result,
                                                       const std::vector<Cause>& closed) {
  const bool nothing_found = result.unnamed.empty();
  if (nothing_found && !leaves_much(result)) return std::nullopt;
  const Eigen::VectorXd weight = weight_of(result.after, result.batch);
  const double share = nothing_found ? thresholds::kMuchBetterHeldOut : thresholds::kAsGoodHeldOut;
  const double limit = share * held_out_square(result.after, result.batch, result.unnamed, weight);
  std::vector<Trial> trials = trials_of(result, closed, weight);
  const auto best =
      std::min_element(trials.begin(), trials.end(),
                       [](const Trial& a, const Trial& b) { return a.square < b.square; });
  if (best == trials.end() || best->square > limit) return std::nullopt;
  NamedInstead named{best->cause, std::move(best->model), {}};
  for (const Trial& other : trials) {
    const bool as_good = other.square <= thresholds::kAsGoodHeldOut * best->square;
    if (as_good && !(other.cause == named.cause)) named.rivals.push_back(other.cause);
  }
  return named;
}

}  // namespace trammel::cause_search
