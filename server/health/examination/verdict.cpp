#include "server/health/examination/verdict.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/health/examination/seen_change.h"

namespace trammel::health {

namespace {

constexpr double kDoubtful = 0.02;  // chance above which the verdict is uncertain

/// `2, 4 and 5`, `2 to 5`; joints are 0-based.
std::string joints_in_words(const std::vector<LostZero>& zeros) {
  const int first = zeros.front().joint + 1, last = zeros.back().joint + 1;
  const auto count = static_cast<int>(zeros.size());
  if (count > 2 && last - first + 1 == count) return fmt::format("{} to {}", first, last);
  std::string text = std::to_string(first);
  for (int k = 1; k < count; ++k)
    text += fmt::format("{}{}", k + 1 < count ? ", " : " and ",
                        zeros[static_cast<std::size_t>(k)].joint + 1);
  return text;
}

/// `lost zero in joint 2 (by 0.100 +- 0.002 deg)`, `the zeros of joints 2 and 4: was it remastered?
/// (joint 2 by 0.100 +- 0.002 deg, alone 1.204 mm rms; ...)`.
std::string change_in_words(const SeenChange& change) {
  if (change.zeros.empty()) return in_words(change.cause);
  const auto by = [](const LostZero& zero) {
    return fmt::format("by {:.3f} +- {:.3f} deg", to_deg(zero.by), to_deg(zero.u95));
  };
  if (change.zeros.size() == 1)
    return fmt::format("{} ({})", in_words(change.cause), by(change.zeros.front()));
  std::vector<std::string> each;
  for (const LostZero& zero : change.zeros)
    each.push_back(fmt::format("joint {} {}, alone {:.3f} mm rms", zero.joint + 1, by(zero),
                               to_mm(zero.effect_rms)));
  return fmt::format("the zeros of joints {}: was it remastered? ({})",
                     joints_in_words(change.zeros), fmt::join(each, "; "));
}

std::string rival_in_words(const SingleCause& cause) {
  return is_zero(cause) && cause.joint < 0 ? "lost zeros in several joints" : in_words(cause);
}

std::string seen_in_words(const HealthCheck& check) {
  std::string text;
  for (const SeenChange& change : check.changed) {
    text += fmt::format("{}{}: {:.3f} +- {:.3f} mm rms {}", text.empty() ? "" : "; ",
                        change_in_words(change), to_mm(change.effect_rms), to_mm(change.u95),
                        change.at_these_poses ? "at these poses" : "over the working poses");
    for (const SingleCause& other : change.could_also_be) text += ", or " + rival_in_words(other);
  }
  return text;
}

/// The measurement that would decide between the named change and its rivals.
std::string what_tells_more(const Doubt& doubt, const HealthCheck& check) {
  const auto is_open = [&](const SingleCause& rival) {
    return !is_zero(rival) || std::find(doubt.in_tool.begin(), doubt.in_tool.end(), rival.joint) ==
                                  doubt.in_tool.end();
  };
  const bool is_sure =
      std::all_of(check.changed.begin(), check.changed.end(), [&](const SeenChange& change) {
        return std::none_of(change.could_also_be.begin(), change.could_also_be.end(), is_open) &&
               change.cause.record != unknown_cause().record;
      });
  std::string text;
  if (!is_sure)
    text +=
        fmt::format("; `trammel plan --check {}` chooses poses that tell more", 2 * check.poses);
  for (const int joint : doubt.in_tool) {
    text += fmt::format(
        "; no poses tell a tool that sits elsewhere from a lost zero of joint {0}, alone or beside "
        "it: look at the mark of joint {0}, or check with another tool",
        joint + 1);
  }
  return text;
}

/// Far beyond anything expected is never chance, whatever the tails of the model's errors are.
bool is_far_beyond(const HealthCheck& check) {
  return check.changed.empty() &&
         check.rms > std::max(kFarOff, kNeverExpected * check.expected_rms);
}

}  // namespace

void tell_verdict(const HealthOptions& options, const Doubt& doubt, HealthCheck& check) {
  const double tolerance = to_mm(options.tolerance);
  if (doubt.is_too_far || is_far_beyond(check)) {
    check.sentence = fmt::format(
        "the poses are off by {:.1f} mm rms, which no small change explains: was the file read as "
        "it was meant (measurements, not targets; no rows or columns exchanged), is it this robot, "
        "is it this tool? `diagnose` says more",
        to_mm(check.rms));
  } else if (!check.changed.empty()) {
    check.verdict = HealthVerdict::kChanged;
    check.sentence = "the robot is not as its model has it; " + seen_in_words(check) +
                     what_tells_more(doubt, check);
  } else if (doubt.scatter > 0) {
    check.sentence = fmt::format(
        "the poses are off by {:.1f} times as much as a healthy robot's, and no change explains "
        "that better than noise does: the instrument measured worse than its sigma says, or "
        "several things changed; measure again, or more poses (`trammel plan --check {}`)",
        doubt.scatter, 2 * check.poses);
  } else if (check.p_value < kDoubtful) {
    check.sentence = fmt::format(
        "these poses are less like the model than {:.1f} % of healthy checks are, which may be "
        "chance: measure again",
        100 * (1 - check.p_value));
  } else if (!check.would_have_seen) {
    check.sentence = "these poses are too few, or too much alike, to show every change";
  } else if (*check.would_have_seen > options.tolerance) {
    check.sentence = fmt::format(
        "these poses could hide {} of {:.3f} mm, the tolerance is {:.3f} mm",
        in_words(check.smallest.front().cause), to_mm(*check.would_have_seen), tolerance);
  } else if (!check.suspects.empty()) {
    check.sentence = fmt::format(
        "pose {} fits neither the model nor the other poses, which are as the model has them: it "
        "was measured wrongly, or something changed that shows only there; measure it again",
        fmt::join(check.suspects, ", "));
    return;
  } else {
    check.verdict = HealthVerdict::kHealthy;
    check.sentence = fmt::format(
        "as its model has it; a change of {:.3f} mm would have been seen, the tolerance is {:.3f} "
        "mm",
        to_mm(*check.would_have_seen), tolerance);
  }
  if (!check.suspects.empty())
    check.sentence += fmt::format("; left out as bad: pose {}", fmt::join(check.suspects, ", "));
}

}  // namespace trammel::health
