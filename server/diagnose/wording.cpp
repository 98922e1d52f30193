#include "server/diagnose/wording.h"

#include "server/base/units.h"

namespace trammel {

namespace {

struct Words {
  const char* cause;
  const char* action;
  const char* needs;
};

constexpr Words kWords[] = {
    {"gear_transmission", "compensate it, and have the gear of this joint looked at if it grows",
     "a wider range of this joint"},
    {"encoder_eccentricity", "compensate it; it is fixed in the joint until its encoder is replaced",
     "the full range of this joint, a second payload"},
    {"joint_map", "compensate it; measure again after service of this joint", "more poses over this joint's range"},
    {"backlash", "approach every target from one side of this joint, or have its gear adjusted",
     "approaching the poses from both sides of this joint"},
    {"link_bending", "compensate it for this payload; identify again when the payload changes",
     "a second known payload, or a run without any"},
    {"compliance", "compensate it for this payload", "a second known payload, or a run without any"},
    {"payload", "weigh the payload and correct the cell file", "a second known payload, or a run without any"},
    {"payload_changed", "find out what was mounted or lost at that pose, and give the poses their payload_id",
     "a payload_id for every pose, wide poses before and after"},
    {"tool", "measure the tool again and correct the cell file", "a second tool"},
    {"tool_changed", "find out what knocked or changed the tool at that pose; measure again after it",
     "a second tool, or reference reflectors on the flange"},
    {"tracker_moved", "fix the tracker (or the robot's base) to the floor and measure the reference reflectors",
     "reference reflectors, measured before and after"},
    {"tracker_drift", "let the tracker warm up, and measure reference reflectors in between",
     "reference reflectors, and the time of every pose"},
    {"joint_slip", "check this joint's brake, coupling and calibration marks, and update its revolution counter",
     "reference reflectors, and the time of every pose"},
    {"thermal_growth", "warm the robot up before work, or record its temperature with every job",
     "temperatures that differ between poses and do not only rise with time"},
    {"wrist_coupling", "set the coupling ratios of the wrist in the controller", "the full range of joints 4 and 5"},
    {"time_lag", "trigger tracker and robot from one clock", "other speeds, and the time of every pose"},
    {"geometry", "identify the geometry", "a wider range of joints"},
    {"base", "localise the base", "reference reflectors that fix where the base stands"},
    {"outlier", "single pose, cause not separable: repeat it and its neighbours", ""},
};

const Words* words_for(const std::string& cause) {
  for (const Words& words : kWords) {
    if (cause == words.cause) return &words;
  }
  return nullptr;
}

std::string listed(const std::vector<std::string>& words) {
  std::string all;
  for (std::size_t k = 0; k < words.size(); ++k)
    all += (k == 0 ? "" : k + 1 == words.size() ? " and " : ", ") + words[k];
  return all;
}

std::string said(const Finding& finding) {
  if (finding.cause.cause == "outlier") return fmt::format("pose {} does not belong", finding.cause.pose_id);
  std::string text = to_string(finding.cause);
  if (finding.cause.order) text += fmt::format(" ({:.2f} cycles a turn)", *finding.cause.order);
  if (!finding.cause.pose_id.empty()) text += fmt::format(" from pose {}", finding.cause.pose_id);
  text += fmt::format(" ({:.0f} um rms)", to_mm(finding.effect_rms) * 1e3);
  if (finding.could_also_be.empty()) return text;
  std::vector<std::string> others;
  for (const Cause& other : finding.could_also_be) others.push_back(to_string(other));
  return text + ", which these poses cannot tell from " + listed(others);
}

}  // namespace

std::string action_for(const Cause& cause, bool ambiguous) {
  const Words* words = words_for(cause.cause);
  if (words == nullptr) return "";
  if (ambiguous) return fmt::format("decide first which it is: {}", words->needs);
  return words->action;
}

std::string what_it_needs(const Cause& cause) {
  const Words* words = words_for(cause.cause);
  return words == nullptr ? "other poses" : words->needs;
}

std::string sentence_for(const Diagnosis& d) {
  std::vector<std::string> findings;
  for (const Finding& finding : d.findings) findings.push_back(said(finding));
  std::string text;
  switch (d.verdict) {
    case Verdict::kNamed:
      text = "The simulation lacks " + listed(findings) + ".";
      break;
    case Verdict::kAmbiguous:
      text = "The simulation lacks something, but I cannot tell what: " + listed(findings) + ".";
      break;
    case Verdict::kUnknown:
      text = fmt::format("Something is there ({:.0f} um rms) that depends on {}, and none of the known causes fits it.",
                         to_mm(d.unexplained.rms) * 1e3, listed(d.unexplained.depends_on));
      return text;
    case Verdict::kNothing:
      return fmt::format(
          "Nothing found: what is left ({:.0f} um rms) is what noise of {:.0f} um an axis leaves over in {} poses.",
          to_mm(d.after.rms) * 1e3, to_mm(d.noise) * 1e3, d.poses);
  }
  if (d.unexplained.present) {
    text += fmt::format(" Besides, something unknown depends on {} ({:.0f} um rms).", listed(d.unexplained.depends_on),
                        to_mm(d.unexplained.rms) * 1e3);
  }
  return text;
}

}  // namespace trammel
