#include "server/report/health_json.h"

#include "server/base/units.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kShownSizes = 5;  // for people: those that are hardest to see

ordered_json length_json(const std::optional<double>& length) {
  return length ? ordered_json(to_mm(*length)) : ordered_json(nullptr);
}

ordered_json cause_json(const SingleCause& cause) {
  ordered_json json = {{"cause", cause.record->spelling}};
  json["joint"] = cause.joint >= 0 ? ordered_json(cause.joint + 1) : ordered_json(nullptr);
  if (!cause.parameter.empty()) json["parameter"] = cause.parameter;
  return json;
}

ordered_json change_json(const SeenChange& change, const CheckedSince& since) {
  ordered_json json = cause_json(change.cause);
  json["effect_rms_mm"] = to_mm(change.effect_rms);
  json["u95"] = to_mm(change.u95);
  json["p_value"] = change.p_value;
  json["since"] = {{"session_id", since.session_id}, {"pose_id", since.pose_id}};
  json["could_also_be"] = ordered_json::array();
  for (const SingleCause& other : change.could_also_be) json["could_also_be"].push_back(cause_json(other));
  return json;
}

}  // namespace

ordered_json health_json(const HealthCheck& check, const CheckedSince& since) {
  ordered_json json = {{"verdict", to_string(check.verdict)},
                       {"tolerance_mm", to_mm(check.tolerance)},
                       {"rms_mm", to_mm(check.rms)},
                       {"expected_rms_mm", to_mm(check.expected_rms)},
                       {"would_have_seen_mm", length_json(check.would_have_seen)},
                       {"changed", ordered_json::array()},
                       {"due", check.due},
                       {"due_because", check.due_because},
                       {"poses", check.poses},
                       {"p_value", check.p_value},
                       {"why", check.sentence},
                       {"suspect_poses", check.suspects},
                       {"smallest_seen", ordered_json::array()},
                       {"not_asked", ordered_json::array()}};
  for (const SeenChange& change : check.changed) json["changed"].push_back(change_json(change, since));
  for (const SmallestEffect& smallest : check.smallest) {
    ordered_json one = cause_json(smallest.cause);
    one["effect_rms_mm"] = length_json(smallest.rms);
    json["smallest_seen"].push_back(std::move(one));
  }
  for (const CauseNotAsked& unseen : check.not_asked) {
    ordered_json one = cause_json(unseen.cause);
    one["needs"] = unseen.needs;
    json["not_asked"].push_back(std::move(one));
  }
  return json;
}

std::string health_text(const HealthCheck& check) {
  std::string text =
      fmt::format("{}: {}\n{} poses: {:.4f} mm rms, a healthy robot has {:.4f}\n", to_string(check.verdict),
                  check.sentence, check.poses, to_mm(check.rms), to_mm(check.expected_rms));
  if (!check.smallest.empty()) text += "hardest to see (mm rms over the working poses, seen with 95 %):\n";
  for (std::size_t i = 0; i < std::min(kShownSizes, check.smallest.size()); ++i) {
    const SmallestEffect& one = check.smallest[i];
    text +=
        fmt::format("  {:34} {}\n", in_words(one.cause), one.rms ? fmt::format("{:.3f}", to_mm(*one.rms)) : "never");
  }
  if (!check.due.empty() || !check.due_because.empty())
    text += fmt::format("next check: {}{}{}\n", check.due, check.due.empty() ? "" : "; ", check.due_because);
  return text;
}

}  // namespace trammel
