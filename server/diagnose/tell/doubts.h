#pragma once

#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// What a finding is judged beside.
struct Beside {
  const std::vector<Cause>& found;   ///< all causes found, the one that is judged among them
  const Unexplained& unexplained;    ///< what depends on something and has no name
  const Surrogates& surrogates;      ///< what was put in for what nobody recorded
  const MeasurementBatch& recorded;  ///< without the surrogates
  bool more_than_noise = false;      ///< is left by all that was found
};

/// How sure the name of a finding is, and what people do about it.
struct Judgement {
  std::vector<Cause> could_also_be;  ///< empty: its name is sure
  bool whole = true;                 ///< false: it has the best known shape, and is not all of what is there
  std::string action;
};

/// Judges a cause whose effect is `effect_rms` (m). `rivals`: what the search could not tell from it. Its name is
/// doubted
/// - where something was not recorded that would show whether it is another cause;
/// - beside something unknown that is several times larger, of which it may be part;
/// - of a gear, where its joint has a map or more than two orders: an error with no single order has as many sines as
///   the poses show;
/// - of what begins at a pose, where it begins a second time: a slow change is several steps;
/// - of an encoder or a payload that is off by more than robots have it (`unlikely`): the weight of the arm itself,
///   or a balancer, does the same through joints that give way;
/// - where more than noise is left. It may be the best known shape of something else. Where half of the poses do not
///   show it by themselves (`in_both_halves`), it may be nothing at all.
/// Of several doubts the action answers the one that comes last in this list.
[[nodiscard]] Judgement judge(const Cause& cause, double effect_rms, const std::vector<Cause>& rivals,
                              const Beside& beside, bool in_both_halves = true, bool unlikely = false);

/// Whether numbers of that size (in units of their priors) are larger than robots have them.
[[nodiscard]] bool is_unlikely(const Cause& cause, const Eigen::VectorXd& size);

}  // namespace trammel::cause_search
