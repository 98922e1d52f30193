#include "server/diagnose/tell/wording.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/diagnose/search/surrogates.h"
#include "server/plan/separation.h"

namespace trammel {

namespace {

constexpr std::size_t kMostDoubtful = 4;  // in a sentence; the findings list them all
constexpr double kMuchMore = 1.3;         // than what is stated for the measurement: what the model lacks is in it

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

bool is_single_pose(const Finding& finding) { return record_of(finding.cause).search == causes::SearchFamily::kPose; }

std::string said(const Finding& finding) {
  if (is_single_pose(finding))
    return fmt::format("pose {} ({:.2f} mm)", finding.cause.pose_id, to_mm(finding.effect_rms));
  std::string text = in_words(finding.cause);
  if (finding.cause.order) text += fmt::format(" ({:.2f} cycles a turn)", *finding.cause.order);
  if (finding.may_begin_at.size() > 1) {
    text += fmt::format(", or another of {} to {},", finding.may_begin_at.front().pose_id,
                        finding.may_begin_at.back().pose_id);
  }
  text += fmt::format(" ({:.0f} um rms)", to_mm(finding.effect_rms) * 1e3);
  if (finding.could_also_be.empty()) return text;
  std::vector<std::string> others;
  for (const Cause& other : finding.could_also_be) others.push_back(in_words(other));
  return text + ", which these poses cannot tell from " + listed(others);
}

}  // namespace

std::string action_for(const Cause& cause, const std::vector<Cause>& others) {
  if (others.empty()) return std::string(record_of(cause).action);
  return fmt::format("decide first which it is: {}", what_would_separate(cause.cause, others.front().cause));
}

std::string what_it_needs(const Cause& cause) { return std::string(record_of(cause).shown_by); }

bool is_looked_for_by_order(const Unseen& unseen, MeasurementBatch recorded) {
  return !unseen.detectable && is_by_surrogate(put_in_surrogates(recorded), unseen.cause);
}

std::string noise_name(double noise, double instrument) {
  return noise > kMuchMore * instrument ? "what stays unexplained of a pose" : "noise of one measurement";
}

std::string why_no_next_poses(const std::vector<Finding>& findings) {
  const auto doubt = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return !finding.could_also_be.empty(); });
  if (doubt == findings.end()) return "no cause that was found is in doubt";
  return fmt::format("no poses of this cell tell {} from {}; {}", in_words(doubt->cause),
                     in_words(doubt->could_also_be.front()), doubt->action);
}

std::string sentence_for(const Diagnosis& d) {
  std::vector<std::string> sure, doubtful, bad;
  for (const Finding& finding : d.findings) {
    (is_single_pose(finding) ? bad : finding.could_also_be.empty() ? sure : doubtful).push_back(said(finding));
  }
  if (const std::size_t all = doubtful.size(); all > kMostDoubtful) {
    doubtful.resize(kMostDoubtful - 1);
    doubtful.push_back(fmt::format("{} more, which the findings list", all - doubtful.size()));
  }
  std::string text;
  const auto add = [&](const std::string& sentence) { text += (text.empty() ? "" : " ") + as_sentence(sentence); };
  if (!sure.empty()) add("This is missing from the simulation: " + listed(sure));
  if (doubtful.size() == 1)
    add("Something is missing that I cannot tell for certain: it may be this: " + doubtful.front());
  if (doubtful.size() > 1)
    add("Some things are missing that I cannot tell for certain: they may be these: " + listed_clauses(doubtful));
  if (bad.size() == 1)
    add(bad.front() + " is an outlier: single pose, cause not separable; repeat it and its neighbours");
  if (bad.size() > 1)
    add(listed(bad) + " are outliers: single poses, cause not separable; repeat them and their neighbours");
  const bool known_of = !d.unexplained.depends_on.empty();
  if (d.unexplained.present && known_of) {
    add(fmt::format("Something{} depends on {} ({:.0f} um rms), and none of the known causes fits it",
                    text.empty() ? "" : " else", listed(d.unexplained.depends_on), 1e6 * d.unexplained.rms));
  }
  if (!d.unexplained.hint.empty()) add(d.unexplained.hint);
  std::vector<std::string> held_out;
  for (const SuspectedPose& pose : d.suspects) {
    if (pose.held_out) held_out.push_back(fmt::format("{} ({:.2f} mm)", pose.pose_id, to_mm(pose.distance)));
  }
  if (!held_out.empty()) {
    add(fmt::format("Of the poses held out, {} {} neither model", listed(held_out),
                    held_out.size() > 1 ? "fit" : "fits"));
  }
  if (sure.empty() && doubtful.empty() && !d.unexplained.present) {
    add(fmt::format("Nothing {} found in {} poses: {:.0f} um rms are left", bad.empty() ? "was" : "else was", d.poses,
                    1e6 * d.after.rms));
  }
  return text;
}

std::string as_sentence(std::string text) {
  if (text.empty()) return text;
  if (text.front() >= 'a' && text.front() <= 'z') text.front() = static_cast<char>(text.front() - 'a' + 'A');
  if (text.back() != '.' && text.back() != '?') text += '.';
  return text;
}

std::string uncertain_by(double share_of_effect) {
  if (share_of_effect >= 1) return "more than the effect itself";
  const double percent = 100 * share_of_effect;
  return percent < 10 ? fmt::format("{:.2g} % of the effect", percent) : fmt::format("{:.0f} % of the effect", percent);
}

}  // namespace trammel
