#include "server/report/health_json.h"

#include <cmath>

#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/report/note_json.h"

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
  json["effect_over"] = change.at_these_poses ? "these_poses" : "working_poses";
  if (!change.zeros.empty()) {
    json["zeros"] = ordered_json::array();
    for (const LostZero& zero : change.zeros)
      json["zeros"].push_back({{"joint", zero.joint + 1}, {"deg", to_deg(zero.by)}, {"u95_deg", to_deg(zero.u95)}});
  }
  json["p_value"] = change.p_value;
  json["since"] = {{"session_id", since.session_id}, {"pose_id", since.pose_id}};
  json["could_also_be"] = ordered_json::array();
  for (const SingleCause& other : change.could_also_be) json["could_also_be"].push_back(cause_json(other));
  return json;
}

ordered_json change_line(const std::string& line, const std::string& kind, const std::string& name) {
  return {{"line", line},
          {"kind", kind},
          {"name", name},
          {"joint", nullptr},
          {"value", nullptr},
          {"u95", nullptr},
          {"unit", nullptr},
          {"alone_rms_mm", nullptr},
          {"with", ordered_json::array()},
          {"action", ""}};
}

/// A line for each zero; what each of several does alone is not known.
void add_zero_lines(const SeenChange& change, ordered_json& lines) {
  for (const LostZero& zero : change.zeros) {
    const std::string n = std::to_string(zero.joint + 1);
    ordered_json line = change_line("zero:" + n, "joint_zero", "the zero of joint " + n);
    line["joint"] = zero.joint + 1;
    line["value"] = to_deg(zero.by);
    line["u95"] = to_deg(zero.u95);
    line["unit"] = "deg";
    if (change.zeros.size() == 1) line["alone_rms_mm"] = to_mm(change.effect_rms);
    for (const LostZero& other : change.zeros)
      if (other.joint != zero.joint) line["with"].push_back("zero:" + std::to_string(other.joint + 1));
    line["action"] = "re-master joint " + n;
    lines.push_back(std::move(line));
  }
}

ordered_json change_line(const SeenChange& change) {
  const int joint = change.cause.joint;
  const std::string cause(change.cause.record->spelling);
  ordered_json line =
      change_line(joint >= 0 ? cause + ":" + std::to_string(joint + 1) : cause, cause, in_words(change.cause));
  if (joint >= 0) line["joint"] = joint + 1;
  line["alone_rms_mm"] = to_mm(change.effect_rms);
  for (const SingleCause& other : change.could_also_be) line["with"].push_back(in_words(other));
  line["action"] = change.cause.record->action;
  return line;
}

/// What changed since the model was made, in the shape of a budget: from what is off now to what a healthy robot
/// leaves.
ordered_json change_budget_json(const HealthCheck& check) {
  ordered_json lines = ordered_json::array();
  for (const SeenChange& change : check.changed) {
    if (change.zeros.empty()) {
      lines.push_back(change_line(change));
    } else {
      add_zero_lines(change, lines);
    }
  }
  ordered_json rest = change_line("rest", "rest", "what a healthy robot leaves");
  rest["alone_rms_mm"] = to_mm(check.expected_rms);
  lines.push_back(std::move(rest));
  return {{"nominal_rms_mm", to_mm(check.rms)}, {"poses", check.poses}, {"lines", std::move(lines)}};
}

constexpr double kMonth = 30 * 86400.0;  // s

ordered_json drift_json(const DriftSeen& drift) {
  ordered_json misfits = ordered_json::array();
  for (const double misfit : drift.misfit) misfits.push_back(std::round(misfit * 1e3) / 1e3);
  return {{"from_unix_s", drift.from}, {"until_unix_s", drift.until}, {"misfit", std::move(misfits)}};
}

ordered_json rate_json(const DriftRate& rate) {
  const auto in_a_month = [](double r) { return to_mm(DriftRate::after(r, kMonth)); };
  return {{"checks", rate.checks},
          {"days", rate.span / 86400},
          {"rms_mm_in_30_days", in_a_month(rate.best)},
          {"at_least_mm", in_a_month(rate.least)},
          {"at_most_mm", in_a_month(rate.most)}};
}

}  // namespace

std::optional<DriftSeen> drift_of(const std::string& check) {
  const ordered_json json = ordered_json::parse(check, nullptr, false);
  if (!json.is_object() || !json.contains("drift_seen") || !json["drift_seen"].is_object()) return std::nullopt;
  const ordered_json& drift = json["drift_seen"];
  for (const char* key : {"from_unix_s", "until_unix_s"})
    if (!drift.contains(key) || !drift[key].is_number_integer()) return std::nullopt;
  if (!drift.contains("misfit") || !drift["misfit"].is_array()) return std::nullopt;
  DriftSeen seen{drift["from_unix_s"], drift["until_unix_s"], {}};
  for (const ordered_json& misfit : drift["misfit"]) {
    if (!misfit.is_number()) return std::nullopt;
    seen.misfit.push_back(misfit);
  }
  return seen;
}

std::string drift_text(const DriftSeen& drift) { return ordered_json{{"drift_seen", drift_json(drift)}}.dump(); }

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
  json["model"] = check.model;
  json["drift_rate"] = check.drift_rate ? rate_json(*check.drift_rate) : ordered_json(nullptr);
  json["drift_seen"] = check.drift ? drift_json(*check.drift) : ordered_json(nullptr);
  for (const SeenChange& change : check.changed) json["changed"].push_back(change_json(change, since));
  json["budget"] = change_budget_json(check);
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

ordered_json check_json(const HealthCheck& check, const CheckedBatch& batch, const CompensatedModel& model) {
  const auto& rows = batch.rows().measurements;
  ordered_json json = health_json(check, {batch.id(), rows.empty() ? "" : rows.front().pose_id});
  json["notes"] = notes_json(notes_of(model));
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
