#include "server/diagnose/tell/wording.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/diagnose/search/surrogates.h"
#include "server/diagnose/thresholds.h"
#include "server/plan/separation.h"

namespace trammel {

namespace {

constexpr std::size_t kMostDoubtful = 4;  // in a sentence; the findings list them all

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

/// Where a step may have begun besides the pose where it was found.
std::string beginning_said(const Finding& finding) {
  if (finding.may_begin_at.size() < 2) return "";
  return fmt::format(", or at another of {} to {},", finding.may_begin_at.front().pose_id,
                     finding.may_begin_at.back().pose_id);
}

bool is_single_pose(const Finding& finding) { return record_of(finding.cause).search == causes::SearchFamily::kPose; }

std::string said(const Finding& finding) {
  if (is_single_pose(finding))
    return fmt::format("pose {} ({:.2f} mm)", finding.cause.pose_id, to_mm(finding.effect_rms));
  std::vector<std::string> names = {in_words(finding.cause) + beginning_said(finding)};
  if (finding.cause.order) names.front() += fmt::format(" ({:.2f} cycles a turn)", *finding.cause.order);
  names.front() += fmt::format(" ({:.0f} um rms)", to_mm(finding.effect_rms) * 1e3);
  if (!finding.whole) return names.front();
  for (const Cause& other : finding.could_also_be) names.push_back(in_words(other));
  return fmt::format("{}", fmt::join(names, ", or "));
}

}  // namespace

std::string action_for(const Cause& cause, const std::vector<Cause>& others) {
  if (others.empty()) return std::string(record_of(cause).action);
  return fmt::format("decide first which it is: {}", what_would_separate(cause.cause, others.front().cause));
}

std::string what_it_needs(const Cause& cause) { return std::string(record_of(cause).shown_by); }

bool is_looked_for_by_order(const Unseen& unseen, MeasurementBatch recorded) {
  return !unseen.detectable && cause_search::is_by_surrogate(cause_search::put_in_surrogates(recorded), unseen.cause);
}

std::string what_slow_changes_need() {
  return "measure some reference poses again and again over the day, with time_s and temperature_c";
}

std::string noise_name(double noise, double instrument) {
  return noise > cause_search::thresholds::kMoreThanNoise * instrument ? "what stays unexplained of a pose"
                                                                       : "noise of one measurement";
}

std::string why_no_next_poses(const std::vector<Finding>& findings) {
  const auto doubt = std::find_if(findings.begin(), findings.end(),
                                  [](const Finding& finding) { return !finding.could_also_be.empty(); });
  if (doubt == findings.end()) return "no cause that was found is in doubt";
  return fmt::format("no poses of this cell tell {} from {}; {}", in_words(doubt->cause),
                     in_words(doubt->could_also_be.front()), doubt->action);
}

namespace {

/// The findings as clauses, by how sure they are.
struct Said {
  std::vector<std::string> sure, parts, doubtful, bad_poses;
};

Said said(const std::vector<Finding>& findings) {
  Said all;
  for (const Finding& finding : findings) {
    (is_single_pose(finding)         ? all.bad_poses
     : !finding.whole                ? all.parts
     : finding.could_also_be.empty() ? all.sure
                                     : all.doubtful)
        .push_back(said(finding));
  }
  if (const std::size_t count = all.doubtful.size(); count > kMostDoubtful) {
    all.doubtful.resize(kMostDoubtful - 1);
    all.doubtful.push_back(fmt::format("{} more, which the findings list", count - all.doubtful.size()));
  }
  return all;
}

std::string bad_poses_said(const std::vector<std::string>& poses) {
  return poses.size() > 1
             ? listed(poses) + " are outliers: single poses, cause not separable; repeat them and their neighbours"
             : poses.front() + " is an outlier: single pose, cause not separable; repeat it and its neighbours";
}

/// Poses held out that fit neither model; empty where there are none.
std::string held_out_said(const std::vector<SuspectedPose>& suspects) {
  std::vector<std::string> poses;
  for (const SuspectedPose& pose : suspects) {
    if (pose.held_out) poses.push_back(fmt::format("{} ({:.2f} mm)", pose.pose_id, to_mm(pose.distance)));
  }
  if (poses.empty()) return "";
  return fmt::format("Of the poses held out, {} {} neither model", listed(poses), poses.size() > 1 ? "fit" : "fits");
}

}  // namespace

std::string sentence_for(const Diagnosis& d) {
  const Said all = said(d.findings);
  const Unexplained& left = d.unexplained;
  std::string text;
  const auto add = [&](const std::string& sentence) {
    if (!sentence.empty()) text += (text.empty() ? "" : " ") + as_sentence(sentence);
  };
  if (!all.sure.empty()) add("Missing from the simulation: " + listed_clauses(all.sure));
  if (!all.parts.empty())
    add("Missing from the simulation, in the best known shape, which is not the whole of it: " +
        listed_clauses(all.parts));
  if (!all.doubtful.empty()) add("Missing, but these poses do not tell which it is: " + listed_clauses(all.doubtful));
  if (!all.bad_poses.empty()) add(bad_poses_said(all.bad_poses));
  if (left.present && !left.depends_on.empty()) {
    add(fmt::format("Something{} depends on {} ({:.0f} um rms), and none of the known causes fits it",
                    text.empty() ? "" : " else", listed(left.depends_on), 1e6 * left.rms));
  }
  add(left.hint);
  add(held_out_said(d.suspects));
  if (all.sure.empty() && all.parts.empty() && all.doubtful.empty() && !left.present) {
    add(fmt::format("Nothing {} found in {} poses: {:.0f} um rms are left", all.bad_poses.empty() ? "was" : "else was",
                    d.poses, 1e6 * d.after.rms));
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
