#include "clients/cli/text/diagnose_text.h"

#include <algorithm>
#include <cmath>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/diagnose/diagnosis.h"
#include "server/diagnose/tell/wording.h"
#include "server/error_sources/spelling.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/figures_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr double kMicrometres = 1000;  // per mm

Cause cause_of(const ordered_json& json) {
  Cause cause{json.at("cause").get<std::string>()};
  cause.parameter = json.value("parameter", "");
  cause.pose_id = json.value("pose_id", "");
  if (!json.at("joint").is_null()) cause.joint = json.at("joint").get<int>() - 1;
  return cause;
}

/// `gear ripple in joint 3`, `single bad pose, pose p28`.
std::string cause_text(const ordered_json& cause) { return in_words(cause_of(cause)); }

std::string causes_text(const ordered_json& causes) {
  std::string text;
  for (const ordered_json& cause : causes) text += (text.empty() ? "" : ", ") + cause_text(cause);
  return text;
}

std::string micrometres(const ordered_json& millimetres) {
  return millimetres.is_null() ? "-"
                               : fmt::format("{:.3g} um", kMicrometres * millimetres.get<double>());
}

/// A long list would be one line that nobody reads.
std::string parameter_lines(const ordered_json& parameters) {
  constexpr int kInALine = 5;
  std::string text;
  int count = 0;
  for (const auto& [name, estimate] : parameters.items()) {
    const Reading reading = reading_of(estimate.at("unit"));
    const ShownValue shown = show_read(estimate.at("value"), estimate.at("u95"), reading);
    const char* between = count == 0 ? "      " : count % kInALine == 0 ? ",\n      " : ", ";
    text += fmt::format("{}{} = {} ± {}{}{}", between, name, shown.value, shown.expanded,
                        reading.unit.empty() ? "" : " ", reading.unit);
    ++count;
  }
  return text.empty() ? "" : text + "\n";
}

std::string beginning_line(const ordered_json& beginning) {
  const auto place = [](const ordered_json& one) {
    const ordered_json& time = one.at("time_s");
    return one.at("pose_id").get<std::string>() +
           (time.is_null() ? "" : fmt::format(" ({:.0f} s)", time.get<double>()));
  };
  return fmt::format("      may have begun at any of {} poses from {} to {} (95 %)\n",
                     beginning.at("pose_ids").size(), place(beginning.at("earliest")),
                     place(beginning.at("latest")));
}

std::string p_text(const ordered_json& value) {
  const double p = value.get<double>();
  return p <= kLeastPValue ? "< 1e-6" : fmt::format("{:.2g}", p);
}

/// The name of the finding, `single bad pose, pose p28` or, in doubt, something less.
std::string name_of(const ordered_json& finding) {
  return called(cause_of(finding), !finding.at("could_also_be").empty());
}

/// `width`: of the column of causes.
std::string finding_lines(const ordered_json& finding, std::size_t width) {
  std::string text =
      fmt::format("  {:<{}}{:>10.1f}{:>10.0f}{:>10}{:>10.4f}{:>10.4f}\n", name_of(finding), width,
                  kMicrometres * finding.at("effect_rms_mm").get<double>(),
                  finding.at("strength").get<double>(), p_text(finding.at("p_value")),
                  finding.at("held_out").at("before").at("rms_mm").get<double>(),
                  finding.at("held_out").at("after").at("rms_mm").get<double>());
  text += parameter_lines(finding.at("parameters"));
  if (finding.contains("may_begin_at") && finding.at("may_begin_at").at("pose_ids").size() > 1) {
    text += beginning_line(finding.at("may_begin_at"));
  }
  if (!finding.value("whole", true)) {
    text += "      explains part of it only: more than noise is left\n";
  } else if (!finding.at("could_also_be").empty()) {
    text += fmt::format("      could also be: {}\n", causes_text(finding.at("could_also_be")));
  }
  if (const auto action = finding.at("action").get<std::string>(); !action.empty()) {
    text += fmt::format("      {}\n", action);
  }
  return text;
}

std::string findings_table(const ordered_json& findings) {
  if (findings.empty()) return "";
  std::size_t width = 34;
  for (const ordered_json& finding : findings) width = std::max(width, name_of(finding).size() + 1);
  constexpr auto kColumns = "  {:<{}}{:>10}{:>10}{:>10}{:>10}{:>10}\n";
  std::string text =
      "\n" + fmt::format(kColumns, "", width, "effect", "strength", "p", "held out", "") +
      fmt::format(kColumns, "cause", width, "um rms", "lambda", "", "before mm", "after mm");
  for (const ordered_json& finding : findings) text += finding_lines(finding, width);
  return text + "  (± is U(k=2): two standard uncertainties)\n";
}

std::string figures_line(const char* name, const ordered_json& figures) {
  if (figures.is_null()) return "";
  return fmt::format("  {:<18}{:>10.4f}{:>10.4f}{:>10.4f}{:>10.4f}\n", name,
                     figures.at("rms_mm").get<double>(), figures.at("mean_mm").get<double>(),
                     figures.at("p997_mm").get<double>(), figures.at("max_mm").get<double>());
}

std::string figures_table(const ordered_json& diagnosis) {
  const ordered_json& held_out = diagnosis.at("held_out");
  std::string text = fmt::format("\n  {:<18}{:>10}{:>10}{:>10}{:>10}\n", "error, mm", "rms", "mean",
                                 "99.7 %", "max") +
                     figures_line("before", diagnosis.at("before")) +
                     figures_line("after", diagnosis.at("after")) +
                     figures_line("held out, before", held_out.at("before")) +
                     figures_line("held out, after", held_out.at("after")) +
                     figures_line("  but suspects", held_out.at("before_without_suspects")) +
                     figures_line("  after, but them", held_out.at("after_without_suspects"));
  if (!held_out.at("before").is_null()) {
    text += fmt::format("  (held out: {})\n", held_out.at("how").get<std::string>());
  }
  return text;
}

std::string unexplained_text(const ordered_json& unexplained) {
  if (!unexplained.at("present").get<bool>()) return "";
  const auto on = unexplained.at("depends_on").get<std::vector<std::string>>();
  // The p-value of the test: without a dependence it is that of the noise.
  const std::string p = fmt::format(" (p {})", p_text(unexplained.at("p_value")));
  return fmt::format("\nUnexplained: {} rms{}. {}\n", micrometres(unexplained.at("rms_mm")),
                     on.empty() ? ", more than the stated noise" + p : "",
                     as_sentence(what_it_changes_with(on) + (on.empty() ? "" : p)));
}

std::string suspects_text(const ordered_json& suspects) {
  if (suspects.empty()) return "";
  std::string text = "\nPoses that do not fit the others:\n";
  for (const ordered_json& pose : suspects) {
    text += fmt::format("  pose {} (row {}): {} off; {}\n", pose.at("pose_id").get<std::string>(),
                        pose.at("row").get<int>(), micrometres(pose.at("distance_mm")),
                        pose.at("reason").get<std::string>());
  }
  return text;
}

/// A sentence about a cause, and the other causes or joints that it concerns.
struct Saying {
  std::string what, of;
};

/// Merges equal sentences: `of` is added to the subjects of an existing one, after `between`.
void say(std::vector<Saying>& sayings, const std::string& what, const std::string& of,
         const char* between) {
  const auto known = std::find_if(sayings.begin(), sayings.end(),
                                  [&](const Saying& one) { return one.what == what; });
  if (known == sayings.end()) {
    sayings.push_back({what, of});
  } else {
    known->of += between + of;
  }
}

/// Causes that this batch could not have shown, or not for certain, and the data that they need;
/// one line for all joints alike.
std::string unseen_lines(const ordered_json& unseen) {
  std::vector<Saying> sayings;
  for (const ordered_json& one : unseen) {
    const auto needs = one.at("needs").get<std::string>();
    if (!one.at("smallest_mm").is_null() || needs.empty()) continue;
    const bool by_order = one.value("looked_for_by_order", false);
    const char* how =
        by_order ? "been named for certain (looked for by the order of the poses)" : "shown";
    const std::string joint =
        one.at("joint").is_null() ? "" : fmt::format(" {}", one.at("joint").get<int>());
    say(sayings,
        fmt::format("would not have {}: {}: needs {}", how, kind_in_words(cause_of(one)), needs),
        joint, "");
  }
  std::string text;
  for (const auto& [what, joints] : sayings) {
    text += fmt::format("  {}{}\n", what, joints.empty() ? "" : " (joints" + joints + ")");
  }
  return text;
}

/// The data that a cause needs to show; empty if none are stated.
std::string need_of(const ordered_json& unseen, const std::string& name) {
  for (const ordered_json& one : unseen) {
    const std::string joint =
        one.at("joint").is_null() ? "" : fmt::format(":{}", one.at("joint").get<int>());
    if (one.at("cause").get<std::string>() + joint == name) return one.at("needs");
  }
  return "";
}

/// True if the cause shows no effect at all. Another part of the text says so.
bool is_never_shown(const ordered_json& unseen, const std::string& name) {
  return std::any_of(unseen.begin(), unseen.end(), [&](const ordered_json& one) {
    const std::string joint =
        one.at("joint").is_null() ? "" : fmt::format(":{}", one.at("joint").get<int>());
    return one.at("smallest_mm").is_null() && one.at("cause").get<std::string>() + joint == name;
  });
}

/// A line per cause: its imitators, and the data that it needs.
std::string not_separable_lines(const ordered_json& diagnosis) {
  std::vector<Saying> sayings;
  for (const ordered_json& group : diagnosis.at("not_separable")) {
    if (is_never_shown(diagnosis.at("could_not_have_seen"), group.front())) continue;
    std::vector<std::string> others;
    for (std::size_t k = 1; k < group.size(); ++k)
      others.push_back(in_words(group[k].get<std::string>()));
    say(sayings, group.front(), fmt::format("{}", fmt::join(others, ", ")), ", ");
  }
  std::string text;
  for (const auto& [name, others] : sayings) {
    const std::string need = need_of(diagnosis.at("could_not_have_seen"), name);
    text += fmt::format("  not told apart by these poses: {} from {}{}\n", in_words(name), others,
                        need.empty() ? "" : fmt::format(" (needs {})", need));
  }
  return text;
}

std::string limits_text(const ordered_json& diagnosis) {
  std::string text;
  for (const ordered_json& limit : diagnosis.at("limits"))
    text += fmt::format("  {}\n", limit.get<std::string>());
  text += not_separable_lines(diagnosis);
  text += unseen_lines(diagnosis.at("could_not_have_seen"));
  return text.empty()
             ? ""
             : "\nWhat this batch could not tell (smallest sizes: --report, --json):\n" + text;
}

/// The size from which a cause is named, with its interval; or the bounds that are known.
std::string proved_size(const ordered_json& cause) {
  const ordered_json& sizes = cause.at("sizes");
  if (sizes.empty()) return "not tried";
  if (cause.at("outcome") == "never_named")
    return fmt::format("not named up to {}, found {} of {}",
                       micrometres(sizes.back().at("effect_rms_mm")),
                       sizes.back().at("found").get<int>(), sizes.back().at("tried").get<int>());
  const ordered_json& interval = cause.at("smallest_95_mm");
  if (cause.at("outcome") == "proved")
    return fmt::format("{} ({} to {})", micrometres(cause.at("smallest_mm")),
                       micrometres(interval.at(0)), micrometres(interval.at(1)));
  int tried = 0, named = 0;
  for (const ordered_json& size : sizes) {
    tried += size.at("tried").get<int>();
    named += size.at("named").get<int>();
  }
  // Without an effect that was missed the lower bound is that of the sizes tried.
  const bool has_bound = named < tried && !interval.at(0).is_null();
  return fmt::format("{}, named {} of {}",
                     has_bound ? micrometres(interval.at(0)) + " or more" : "not known yet", named,
                     tried);
}

std::string proof_table(const ordered_json& diagnosis) {
  if (!diagnosis.contains("proof") || diagnosis.at("proof").is_null()) return "";
  const ordered_json& proof = diagnosis.at("proof");
  const ordered_json& nothing = proof.at("nothing_put_in");
  std::string text = fmt::format(
      "\nProved in the residuals of this batch: named with {:.0f} % from this size on (rms; in "
      "brackets 95 %)\n  {:<40}{:<13}{}\n",
      100 * proof.at("named_share").get<double>(), "cause", "predicted", "proved");
  int open = 0, tried = 0, misnamed = 0;
  for (const ordered_json& cause : proof.at("causes")) {
    open += cause.at("outcome") == "open" ? 1 : 0;
    for (const ordered_json& size : cause.at("sizes")) {
      tried += size.at("tried").get<int>();
      misnamed += size.at("misnamed").get<int>();
    }
    text += fmt::format("  {:<40}{:<13}{}\n", cause_text(cause),
                        micrometres(cause.at("predicted_mm")), proved_size(cause));
  }
  text += fmt::format(
      "  (another cause named for sure: {} of {} diagnoses; with nothing put in: {} of {})\n",
      misnamed, tried, nothing.at("misnamed").get<int>(), nothing.at("tried").get<int>());
  if (open > 0)
    text += fmt::format("  ({} of {} causes are not decided: more --prove-minutes decide them)\n",
                        open, proof.at("causes").size());
  return text;
}

std::string next_poses_text(const ordered_json& diagnosis) {
  if (diagnosis.at("next_poses").empty()) return "";
  const ordered_json& worth = diagnosis.at("next_poses_for");
  std::string text =
      fmt::format("\nNext poses, to tell apart {} (uncertain by {} now, by {} with them):\n",
                  causes_text(worth.at("separate")), uncertain_by(worth.at("stddev_now")),
                  uncertain_by(worth.at("stddev_expected")));
  for (const ordered_json& pose : diagnosis.at("next_poses")) {
    text += " ";
    for (const ordered_json& value : pose) text += fmt::format("{:>10.2f}", value.get<double>());
    text += "\n";
  }
  return text;
}

/// The residual of a pose as one length, comparable with the other errors.
std::string noise_line(const ordered_json& diagnosis) {
  const double noise = diagnosis.at("noise_mm"), root = std::sqrt(3.0);
  return fmt::format(
      "{} poses. Noise: {} rms, what is left of a position when all that was found is corrected "
      "({}).\n",
      diagnosis.at("poses").get<int>(), micrometres(root * noise),
      diagnosis.at("noise_from").get<std::string>());
}

std::string extended_line(const char* name, const CompensatedModel& model) {
  return figures_line(name, figures_json(model.parts().validation->compensated));
}

/// The origin of the drawing's error.
std::string budget_text(const ordered_json& budget) {
  if (budget.is_null()) return "";
  std::string text;
  for (const ordered_json& line : budget.at("sentences"))
    text += fmt::format("{}{}\n", text.empty() ? "" : "  ", line.get<std::string>());
  return text;
}

}  // namespace

std::string diagnosis_text(const ordered_json& diagnosis) {
  return fmt::format("{}: {}\n", verdict_in_words(diagnosis.at("verdict").get<std::string>()),
                     diagnosis.at("sentence").get<std::string>()) +
         noise_line(diagnosis) + findings_table(diagnosis.at("findings")) +
         figures_table(diagnosis) + unexplained_text(diagnosis.at("unexplained")) +
         suspects_text(diagnosis.at("suspect_poses")) +
         budget_text(diagnosis.value("budget", ordered_json())) + limits_text(diagnosis) +
         proof_table(diagnosis) + next_poses_text(diagnosis);
}

std::string next_poses_csv(const ordered_json& diagnosis) {
  std::string text = "pose_id";
  for (const ordered_json& column : diagnosis.at("next_poses_for").at("columns")) {
    text += "," + column.get<std::string>();
  }
  text += "\n";
  int number = 0;
  for (const ordered_json& pose : diagnosis.at("next_poses")) {
    text += fmt::format("n{}", ++number);
    for (const ordered_json& value : pose) text += "," + csv_number(value.get<double>());
    text += "\n";
  }
  return text;
}

std::string extension_text(const Extension& extension) {
  const int poses = extension.after.parts().validation->poses;
  return fmt::format("\nWith bias, on {} poses held out from diagnosis and training:\n", poses) +
         fmt::format("  {:<18}{:>10}{:>10}{:>10}{:>10}\n", "error, mm", "rms", "mean", "99.7 %",
                     "max") +
         extended_line("before", extension.before) + extended_line("extended", extension.after) +
         fmt::format("  {}\n", to_string(extension.gain)) +
         fmt::format("  {}\n", extension.day
                                   ? to_string(*extension.day)
                                   : "too few poses to say what another day gains by it") +
         (extension.left_out.empty() ? "" : fmt::format("  {}\n", to_string(extension.left_out)));
}

namespace {

ordered_json another_day_json(const std::optional<DayGain>& day) {
  if (!day) return nullptr;
  return {{"blocks", day->blocks},
          {"poses", day->gain.poses},
          {"before_rms_mm", to_mm(day->gain.rms_before)},
          {"after_rms_mm", to_mm(day->gain.rms_after)},
          {"gain", day->share},
          {"gain_95", {day->lower, day->upper}}};
}

}  // namespace

ordered_json extension_json(const Extension& extension) {
  ordered_json left_out = ordered_json::array();
  for (const Unsupported& one : extension.left_out)
    left_out.push_back({{"source", one.source}, {"z", one.z}});
  return {{"better", extension.why_not().empty()},
          {"z", extension.gain.z()},
          {"z_limit", PairedGain::kBeyondChance},
          {"judged_without", extension.gain.left_out},
          {"another_day", another_day_json(extension.day)},
          {"error_sources", extension.sources},
          {"left_out", std::move(left_out)},
          {"of_the_cell", extension.lasting},
          {"held_out_poses", extension.after.parts().validation->poses},
          {"before", figures_json(extension.before.parts().validation->compensated)},
          {"after", figures_json(extension.after.parts().validation->compensated)}};
}

}  // namespace trammel::cli
