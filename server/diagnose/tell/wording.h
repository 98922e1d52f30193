#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel {

/// The action on the shop floor against a cause that may also be one of `others`.
[[nodiscard]] std::string action_for(const Cause& cause, const std::vector<Cause>& others);
/// The columns and poses that a batch needs to show a cause which this one cannot show.
[[nodiscard]] std::string what_it_needs(const Cause& cause);
/// True if a cause that could not have been seen was still searched for by the order of the poses:
/// it would have been found, but never named for certain. `recorded`: the batch without surrogates.
[[nodiscard]] bool is_looked_for_by_order(const Unseen& unseen, MeasurementBatch recorded);
/// The measurement that would separate a slow change from a sudden one. Requires no column that the
/// batch already has.
[[nodiscard]] std::string what_slow_changes_need(const cause_search::Surrogates& unrecorded);
/// The circumstances `q2`, `q3`, `time` with which something changes, in words: `the positions of
/// joints 2 and 3, and time`.
[[nodiscard]] std::string circumstances_in_words(const std::vector<std::string>& on);
/// The quantities on which the unexplained part depends, as a clause. A dependence that was not
/// found may still exist.
[[nodiscard]] std::string what_it_changes_with(const std::vector<std::string>& on);
/// True if the batch shows nothing of the cause, so that its separation from others is not worth
/// reporting.
[[nodiscard]] bool is_never_shown(const Diagnosis& diagnosis, const Cause& cause);
/// True if what is left may be called noise: it is not more than chance and the uncertainty of
/// sigma allow, and less than three times `sigma`, the one of the cell file or of the rows.
[[nodiscard]] bool looks_like_noise(const LeftOver& left, double sigma);
/// The name of what is left of a pose: the noise of one measurement, or what stays unexplained.
[[nodiscard]] std::string noise_name(const LeftOver& left, double sigma);
/// What is left of a position when all that was found is corrected, for every door: its name, and
/// what it means.
struct WhatIsLeft {
  double times = 1;        ///< the stated sigma
  bool is_noise = true;    ///< looks_like_noise()
  std::string noise_from;  ///< what else is known of the noise

  [[nodiscard]] std::string name() const;
  [[nodiscard]] std::string meaning() const;
};
[[nodiscard]] WhatIsLeft what_is_left(const Diagnosis& diagnosis);
/// The reason why no next poses are suggested, given that only these `findings` could need them.
[[nodiscard]] std::string why_no_next_poses(const std::vector<Finding>& findings);
/// The verdict for people: the missing causes, the largest first; their share of the error; the
/// first action.
[[nodiscard]] std::string sentence_for(const Diagnosis& diagnosis);
/// Begins with a capital and ends with a full stop.
[[nodiscard]] std::string as_sentence(std::string text);
/// The uncertainty of a confounded effect, given as a share of the effect: `6 % of the effect`.
[[nodiscard]] std::string uncertain_by(double share_of_effect);

}  // namespace trammel
