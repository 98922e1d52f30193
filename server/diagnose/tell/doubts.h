#pragma once

#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// The other findings and facts that a finding is judged by.
struct Beside {
  const std::vector<Cause>& found;   ///< all causes found, the one that is judged among them
  const Unexplained& unexplained;    ///< the nameless dependences
  const Surrogates& surrogates;      ///< substitutes for quantities that were not recorded
  const MeasurementBatch& recorded;  ///< without the surrogates
  bool more_than_noise = false;      ///< the findings leave more than noise, or nameless functions
                                     ///< exist
  double left = 0;                   ///< m: how much that is
  bool larger = false;               ///< the residual is larger than stated, and not by chance
};

/// The evidence for a finding.
struct Evidence {
  double effect_rms = 0;       ///< m
  bool in_both_halves = true;  ///< either half of the poses shows it by itself
  bool helps_held_out = true;  ///< held-out poses are predicted better with it
  bool unlikely = false;       ///< it is larger than in real robots
  int numbers = 1;             ///< the number of its parameters
  bool changes = false;        ///< its size changed while the batch was measured
};

/// The certainty of a finding's name, and the action for people.
struct Judgement {
  std::vector<Cause> could_also_be;  ///< empty: its name is sure
  bool whole = true;  ///< false: it is the best known shape, but not all of the effect
  std::string action;
};

/// Judges a cause. `rivals`: the causes that the search could not distinguish from it. Its name is
/// uncertain in these cases:
/// - a quantity was not recorded that would show whether it is another cause;
/// - an unknown effect beside it is several times larger, and it may be a part of that;
/// - it is an order of a gear, and its joint has a map or more than two orders: an error without a
///   single order has as many sines as the poses show;
/// - it begins at a pose, and it begins a second time, or an unknown effect beside it depends on
///   time: a slow change consists of several steps;
/// - it is an encoder or a payload that is off by more than in real robots: the weight of the arm
///   itself, or a balancer, has the same effect through compliant joints;
/// - it is an arm that grows with the temperature, beside an instrument that moved or an unknown
///   effect that depends on time: the scale of the instrument may change with the temperature,
///   which also moves the base;
/// - held-out poses are not predicted better with it;
/// - more than noise is left, named or not. The nearest known cause explains a part of an effect of
///   an unknown form, so the finding may be the best known shape of such an effect. If half of the
///   poses do not show it by themselves, it may be nothing at all. The action answers the last of
///   the doubts in this list that apply.
[[nodiscard]] Judgement judge(const Cause& cause, const Evidence& evidence,
                              const std::vector<Cause>& rivals, const Beside& beside);

/// True if each of `others` is the cause itself by another number, or a description of it. The
/// choice among them may stay open, since they have the same effect on the poses.
[[nodiscard]] bool differ_in_form_only(const Cause& cause, const std::vector<Cause>& others);

/// True if numbers of that size (in units of their priors) are larger than in real robots.
[[nodiscard]] bool is_unlikely(const Cause& cause, const Eigen::VectorXd& size);

}  // namespace trammel::cause_search
