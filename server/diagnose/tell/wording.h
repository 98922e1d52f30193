#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/search/surrogates.h"

namespace trammel {

/// The action that people on the shop floor take against a cause that may also be `others`.
[[nodiscard]] std::string action_for(const Cause& cause, const std::vector<Cause>& others);
/// The columns and poses that a batch would need to show a cause that this one cannot show.
[[nodiscard]] std::string what_it_needs(const Cause& cause);
/// True if a cause that could not have been seen was looked for all the same, by the order of the
/// poses: it would have been found, but never named for certain. `recorded`: the batch without
/// surrogates.
[[nodiscard]] bool is_looked_for_by_order(const Unseen& unseen, MeasurementBatch recorded);
/// The measurement that would tell a slow change from a sudden one. Asks for no column that the
/// batch has.
[[nodiscard]] std::string what_slow_changes_need(const cause_search::Surrogates& unrecorded);
/// The circumstances `q2`, `q3`, `time` with which something changes, in words: `the positions of
/// joints 2 and 3, and time`.
[[nodiscard]] std::string circumstances_in_words(const std::vector<std::string>& on);
/// The circumstances that the unexplained was found to depend on, as a clause. That nothing was
/// found is no proof that nothing is there.
[[nodiscard]] std::string what_it_changes_with(const std::vector<std::string>& on);
/// True if the batch shows nothing at all of the cause, which is then not worth telling from
/// others.
[[nodiscard]] bool is_never_shown(const Diagnosis& diagnosis, const Cause& cause);
/// The name of what `noise` is of, m per axis: one measurement, or more than what is stated for the
/// `instrument`.
[[nodiscard]] std::string noise_name(double noise, double instrument);
/// Why no poses are suggested to measure next, after no others than `findings`.
[[nodiscard]] std::string why_no_next_poses(const std::vector<Finding>& findings);
/// The verdict for people: what is missing, the largest first; how much of the error it is; what to
/// do first.
[[nodiscard]] std::string sentence_for(const Diagnosis& diagnosis);
/// Begins with a capital and ends with a full stop.
[[nodiscard]] std::string as_sentence(std::string text);
/// The uncertainty of what is confounded, whose standard deviation is known as a share of the
/// effect found: `6 % of the effect`.
[[nodiscard]] std::string uncertain_by(double share_of_effect);

}  // namespace trammel
