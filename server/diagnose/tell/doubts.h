#pragma once

#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel::cause_search {

/// The other findings and facts that a finding is judged by.
struct Beside {
  const std::vector<Cause>& found;   ///< all causes found, the one that is judged among them
  const Unexplained& unexplained;    ///< what depends on something and has no name
  const Surrogates& surrogates;      ///< what was put in for what nobody recorded
  const MeasurementBatch& recorded;  ///< without the surrogates
  bool more_than_noise = false;      ///< is left by all that was found, or by what has no name
  double left = 0;                   ///< m: how much that is
  bool larger = false;               ///< what is left is larger than stated, and not by chance
};

/// The evidence for a finding.
struct Evidence {
  double effect_rms = 0;       ///< m
  bool in_both_halves = true;  ///< either half of the poses shows it by itself
  bool helps_held_out = true;  ///< poses held out are predicted better with it
  bool unlikely = false;       ///< it is larger than robots have it
  int numbers = 1;             ///< that it has
  bool changes = false;        ///< its size changed while the batch was measured
};

/// The certainty of a finding's name, and what people do about it.
struct Judgement {
  std::vector<Cause> could_also_be;  ///< empty: its name is sure
  bool whole = true;  ///< false: it has the best known shape, and is not all of what is there
  std::string action;
};

/// Judges a cause. `rivals`: what the search could not tell from it. Its name is doubted
/// - where something was not recorded that would show whether it is another cause;
/// - beside something unknown that is several times larger, of which it may be part;
/// - of a gear, where its joint has a map or more than two orders: an error with no single order
/// has as many sines as
///   the poses show;
/// - of what begins at a pose, where it begins a second time, or beside something unknown that
/// depends on time: a slow
///   change is several steps;
/// - of an encoder or a payload that is off by more than robots have it: the weight of the arm
/// itself, or a balancer,
///   does the same through joints that give way;
/// - of an arm that grows with the temperature, beside an instrument that moved or something
/// unknown that depends on
///   time: the scale of the instrument may go with the temperature, and it moves the base as well;
/// - where poses held out are not predicted better with it;
/// - where more than noise is left, named or not. What has another form than all known causes is
/// explained in part by
///   the nearest of them: the finding may be the best known shape of that. Where half of the poses
///   do not show it by themselves, it may be nothing at all.
/// The action answers one of several doubts: the one that comes last in this list.
[[nodiscard]] Judgement judge(const Cause& cause, const Evidence& evidence,
                              const std::vector<Cause>& rivals, const Beside& beside);

/// True if all of `others` are the cause itself by another number or a description of it: which of
/// them it is may stay open, for they do the same to the poses.
[[nodiscard]] bool differ_in_form_only(const Cause& cause, const std::vector<Cause>& others);

/// True if numbers of that size (in units of their priors) are larger than robots have them.
[[nodiscard]] bool is_unlikely(const Cause& cause, const Eigen::VectorXd& size);

}  // namespace trammel::cause_search
