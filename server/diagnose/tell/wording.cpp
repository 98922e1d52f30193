#include "server/diagnose/tell/wording.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/diagnose/search/surrogates.h"
#include "server/diagnose/thresholds.h"
#include "server/measurement/computed_positions.h"
#include "server/plan/separation.h"

namespace trammel {

namespace {

constexpr std::size_t kMostNamed = 4;  // in a sentence; the findings list them all

std::string listed(const std::vector<std::string>& words) {
  std::string all;
  for (std::size_t k = 0; k < words.size(); ++k)
    all += (k == 0 ? "" : k + 1 == words.size() ? " and " : ", ") + words[k];
  return all;
}

/// Clauses that have commas of their own.
std::string listed_clauses(const std::vector<std::string>& clauses) {
  std::string all;
  for (std::size_t k = 0; k < clauses.size(); ++k)
    all += (k == 0 ? "" : k + 1 == clauses.size() ? "; and " : "; ") + clauses[k];
  return all;
}

/// The other poses at which a step may have begun.
std::string beginning_said(const Finding& finding) {
  if (finding.may_begin_at.size() < 2) return "";
  return fmt::format(", or at another of {} to {},", finding.may_begin_at.front().pose_id,
                     finding.may_begin_at.back().pose_id);
}

bool is_single_pose(const Finding& finding) {
  return record_of(finding.cause).search == causes::SearchFamily::kPose;
}

std::string name_of(const Finding& finding) {
  const std::string order =
      finding.cause.order ? fmt::format(", {:.2f} cycles a turn", *finding.cause.order) : "";
  return in_words(finding.cause) + beginning_said(finding) + order;
}

std::string size_of(const Finding& finding) {
  return fmt::format("{:.0f} um rms", 1e6 * finding.effect_rms);
}

std::string said(const Finding& finding) {
  if (is_single_pose(finding))
    return fmt::format("pose {} ({:.2f} mm)", finding.cause.pose_id, to_mm(finding.effect_rms));
  return fmt::format("{} ({})", name_of(finding), size_of(finding));
}

/// The known causes that a finding in doubt may be, itself first.
std::vector<Cause> candidates_of(const Finding& finding) {
  std::vector<Cause> all = {finding.cause};
  for (const Cause& other : finding.could_also_be) {
    if (other.cause != unknown_cause().cause) all.push_back(other);
  }
  return all;
}

/// `tracker drift or thermal growth (20 um rms)`, `perhaps tracker drift (20 um rms)` where no
/// other cause is known.
std::string said_in_doubt(const Finding& finding) {
  std::vector<std::string> names = {name_of(finding)};
  for (const Cause& other : candidates_of(finding)) {
    if (!(other == finding.cause)) names.push_back(in_words(other));
  }
  return fmt::format("{}{} ({})", names.size() > 1 ? "" : "perhaps ", fmt::join(names, " or "),
                     size_of(finding));
}

}  // namespace

std::string action_for(const Cause& cause, const std::vector<Cause>& others) {
  if (others.empty()) return std::string(record_of(cause).action);
  return fmt::format("decide first which it is: {}",
                     what_would_separate(cause.cause, others.front().cause));
}

std::string what_it_needs(const Cause& cause) { return std::string(record_of(cause).shown_by); }

bool is_looked_for_by_order(const Unseen& unseen, MeasurementBatch recorded) {
  return !unseen.detectable &&
         cause_search::is_by_surrogate(cause_search::put_in_surrogates(recorded), unseen.cause);
}

std::string what_slow_changes_need(const cause_search::Surrogates& unrecorded) {
  std::vector<std::string> columns;
  if (unrecorded.time) columns.emplace_back("time_s");
  if (unrecorded.temperature) columns.emplace_back("temperature_c");
  return "measure some reference poses again and again over the day" +
         (columns.empty() ? "" : ", and record " + listed(columns));
}

bool is_never_shown(const Diagnosis& diagnosis, const Cause& cause) {
  const auto& unseen = diagnosis.could_not_have_seen;
  return std::any_of(unseen.begin(), unseen.end(), [&](const Unseen& one) {
    return one.cause == cause && !one.detectable && !one.needs.empty();
  });
}

std::string noise_name(double noise, double instrument) {
  return noise > cause_search::thresholds::kMoreThanNoise * instrument
             ? "what stays unexplained of a pose"
             : "noise of one measurement";
}

std::string why_no_next_poses(const std::vector<Finding>& findings) {
  const auto doubt = std::find_if(findings.begin(), findings.end(), [](const Finding& finding) {
    return !finding.could_also_be.empty();
  });
  if (doubt == findings.end()) return "no cause that was found is in doubt";
  return fmt::format("no poses of this cell tell {} from {}; {}", in_words(doubt->cause),
                     in_words(doubt->could_also_be.front()), doubt->action);
}

namespace {

/// The findings by certainty. Of several in doubt that may be the same causes, only the first is
/// listed.
struct Told {
  std::vector<const Finding*> sure, parts, doubtful, bad_poses;
};

bool are_the_same_doubt(const Finding& one, const Finding& other) {
  const std::vector<Cause> a = candidates_of(one), b = candidates_of(other);
  return std::is_permutation(a.begin(), a.end(), b.begin(), b.end());
}

Told told(const std::vector<Finding>& findings) {
  Told all;
  for (const Finding& finding : findings) {
    auto& group = is_single_pose(finding)         ? all.bad_poses
                  : !finding.whole                ? all.parts
                  : finding.could_also_be.empty() ? all.sure
                                                  : all.doubtful;
    const bool again = &group == &all.doubtful &&
                       std::any_of(group.begin(), group.end(), [&](const Finding* other) {
                         return are_the_same_doubt(*other, finding);
                       });
    if (!again) group.push_back(&finding);
  }
  return all;
}

/// The first few, and how many more there are.
std::vector<std::string> clauses_of(const std::vector<const Finding*>& findings,
                                    std::string (*words)(const Finding&)) {
  const bool too_many = findings.size() > kMostNamed;
  std::vector<std::string> clauses;
  for (std::size_t k = 0; k < (too_many ? kMostNamed - 1 : findings.size()); ++k)
    clauses.push_back(words(*findings[k]));
  if (too_many)
    clauses.push_back(
        fmt::format("{} smaller ones, which the findings list", findings.size() - clauses.size()));
  return clauses;
}

std::string bad_poses_said(const std::vector<const Finding*>& findings) {
  std::vector<std::string> poses;
  for (const Finding* finding : findings) poses.push_back(said(*finding));
  const bool may_be_missing =
      std::any_of(findings.begin(), findings.end(),
                  [](const Finding* finding) { return !finding->could_also_be.empty(); });
  if (may_be_missing)
    return listed(poses) +
           (poses.size() > 1
                ? " fit none of the others, and what the simulation lacks may be largest there: "
                  "measure them and their neighbours again, which tells that from wrong rows"
                : " fits none of the others, and what the simulation lacks may be largest there: "
                  "measure it and its neighbours again, which tells that from a wrong row");
  return listed(poses) + (poses.size() > 1 ? " fit none of the others, and single poses do not "
                                             "tell why: measure them and their neighbours again"
                                           : " fits none of the others, and a single pose does not "
                                             "tell why: measure it and its neighbours again");
}

/// The error before and after all that goes into the model; empty where that is nothing.
std::string gain_said(const Diagnosis& d, const Told& all) {
  if (all.sure.empty() && all.parts.empty()) return "";
  if (!(d.after.rms < d.before.rms)) return "";
  return fmt::format("With that corrected, the error falls from {:.0f} to {:.0f} um rms",
                     1e6 * d.before.rms, 1e6 * d.after.rms);
}

/// The advice about the largest finding.
std::string advice_said(const Diagnosis& d) {
  const auto first = std::find_if(d.findings.begin(), d.findings.end(),
                                  [](const Finding& finding) { return !is_single_pose(finding); });
  if (first == d.findings.end() || first->action.empty()) return "";
  return fmt::format("What to do about {}: {}", in_words(first->cause), first->action);
}

std::string unexplained_said(const Unexplained& left, bool beside_findings) {
  if (!left.present || left.depends_on.empty()) return "";
  return fmt::format("{} error changes with {} ({:.0f} um rms), as it would by no known cause",
                     beside_findings ? "Besides, the" : "The",
                     circumstances_in_words(left.depends_on), 1e6 * left.rms);
}

/// Poses held out that fit neither model; empty where there are none.
std::string held_out_said(const std::vector<SuspectedPose>& suspects) {
  std::vector<std::string> poses;
  for (const SuspectedPose& pose : suspects) {
    if (pose.held_out)
      poses.push_back(fmt::format("{} ({:.2f} mm)", pose.pose_id, to_mm(pose.distance)));
  }
  if (poses.empty()) return "";
  return fmt::format("Of the poses held out, {} {} neither model", listed(poses),
                     poses.size() > 1 ? "fit" : "fits");
}

}  // namespace

std::string circumstances_in_words(const std::vector<std::string>& on) {
  std::vector<std::string> joints, sides, others;
  for (const std::string& one : on) {
    if (one.starts_with("q")) {
      joints.push_back(one.substr(1));
    } else if (one.starts_with("dir")) {
      sides.push_back(one.substr(3));
    } else {
      others.push_back(one == "time" ? one : "the " + one);
    }
  }
  const auto of_joints = [](const char* one, const char* several,
                            const std::vector<std::string>& numbers) {
    return numbers.size() > 1 ? fmt::format("the {} of joints {}", several, listed(numbers))
                              : fmt::format("the {} of joint {}", one, numbers.front());
  };
  if (!sides.empty())
    others.insert(others.begin(), of_joints("side of approach", "sides of approach", sides));
  if (!joints.empty()) others.insert(others.begin(), of_joints("position", "positions", joints));
  return others.size() == 2 && joints.size() > 1 ? others[0] + ", and " + others[1]
                                                 : listed(others);
}

std::string what_it_changes_with(const std::vector<std::string>& on) {
  if (on.empty()) return "no single joint, torque or time was found with which it changes";
  return "it changes with " + circumstances_in_words(on);
}

std::string sentence_for(const Diagnosis& d) {
  const Told all = told(d.findings);
  const bool found = !all.sure.empty() || !all.parts.empty() || !all.doubtful.empty();
  std::string text;
  const auto add = [&](const std::string& sentence) {
    if (!sentence.empty()) text += (text.empty() ? "" : " ") + as_sentence(sentence);
  };
  const std::string drawing = d.budget ? lead_of(*d.budget) : "";
  add(drawing);
  if (!all.sure.empty())
    add("Missing from the simulation: " + listed_clauses(clauses_of(all.sure, said)));
  if (!all.parts.empty())
    add("These known causes explain part of the error, not all of it: " +
        listed_clauses(clauses_of(all.parts, said)));
  if (!all.doubtful.empty())
    add("Found, but these poses leave open what it is: " +
        listed_clauses(clauses_of(all.doubtful, said_in_doubt)));
  add(gain_said(d, all));
  if (!all.bad_poses.empty()) add(bad_poses_said(all.bad_poses));
  add(unexplained_said(d.unexplained, found || !all.bad_poses.empty()));
  add(d.unexplained.hint);
  if (d.unexplained.present && d.unexplained.depends_on.empty()) add(what_it_changes_with({}));
  add(held_out_said(d.suspects));
  if (!found && !d.unexplained.present) {
    const std::string nothing = fmt::format(
        "{} {} found in {} poses: ", drawing.empty() ? "Nothing" : "Beyond that nothing",
        all.bad_poses.empty() ? "was" : "else was", d.poses);
    auto computed = computed_by_its_arm(d.before.rms, d.poses);
    if (!computed && d.budget)
      computed = computed_not_measured(d.budget->beyond_frames.error_rms, d.instrument, d.poses);
    add(nothing + computed.value_or(fmt::format("{:.0f} um rms are left, which looks like noise",
                                                1e6 * d.after.rms)));
  }
  add(advice_said(d));
  return text;
}

std::string as_sentence(std::string text) {
  if (text.empty()) return text;
  if (text.front() >= 'a' && text.front() <= 'z')
    text.front() = static_cast<char>(text.front() - 'a' + 'A');
  if (text.back() != '.' && text.back() != '?') text += '.';
  return text;
}

std::string uncertain_by(double share_of_effect) {
  if (share_of_effect >= 1) return "more than the effect itself";
  const double percent = 100 * share_of_effect;
  return percent < 10 ? fmt::format("{:.2g} % of the effect", percent)
                      : fmt::format("{:.0f} % of the effect", percent);
}

}  // namespace trammel
