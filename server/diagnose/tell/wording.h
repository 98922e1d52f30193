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
/// The name of a noise of `noise` m per axis: that of one measurement, or more than the stated one
/// of the `instrument`.
[[nodiscard]] std::string noise_name(double noise, double instrument);
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
