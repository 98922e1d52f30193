#include "server/report/diagnosis_json.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/diagnose/tell/wording.h"
#include "server/measurement/pose_columns.h"
#include "server/report/budget_json.h"
#include "server/report/figures_json.h"
#include "server/report/note_json.h"
#include "server/report/session_changes_json.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

ordered_json figures_or_null(const std::optional<ErrorFigures>& figures) {
  return figures ? figures_json(*figures) : ordered_json(nullptr);
}

ordered_json cause_json(const Cause& cause) {
  ordered_json json = {{"cause", cause.cause}};
  json["joint"] = cause.joint >= 0 ? ordered_json(cause.joint + 1) : ordered_json(nullptr);
  if (!cause.parameter.empty()) json["parameter"] = cause.parameter;
  if (!cause.pose_id.empty()) json["pose_id"] = cause.pose_id;
  if (cause.order) json["order"] = *cause.order;
  return json;
}

ordered_json causes_json(const std::vector<Cause>& causes) {
  ordered_json list = ordered_json::array();
  for (const Cause& cause : causes) list.push_back(cause_json(cause));
  return list;
}

ordered_json beginning_json(const std::vector<PossibleBeginning>& places) {
  const auto place_json = [](const PossibleBeginning& place) {
    return ordered_json{{"pose_id", place.pose_id},
                        {"row", place.row},
                        {"time_s", place.time ? ordered_json(*place.time) : ordered_json(nullptr)}};
  };
  ordered_json ids = ordered_json::array();
  for (const PossibleBeginning& place : places) ids.push_back(place.pose_id);
  return {{"earliest", place_json(places.front())},
          {"latest", place_json(places.back())},
          {"pose_ids", ids}};
}

ordered_json finding_json(const Finding& finding) {
  ordered_json json = cause_json(finding.cause);
  json["source"] = finding.source;
  json["parameters"] = ordered_json::object();
  for (const Estimate& estimate : finding.parameters) {
    json["parameters"][estimate.name] = {
        {"value", estimate.value}, {"u95", estimate.u95}, {"unit", estimate.unit}};
  }
  if (!finding.may_begin_at.empty()) json["may_begin_at"] = beginning_json(finding.may_begin_at);
  if (!finding.since_session.empty())
    json["since"] = {{"session_id", finding.since_session}, {"pose_id", finding.cause.pose_id}};
  json["effect_rms_mm"] = to_mm(finding.effect_rms);
  json["held_out"] = {{"before", figures_json(finding.held_out_before)},
                      {"after", figures_json(finding.held_out_after)}};
  json["held_out_gain_mm"] = to_mm(finding.held_out_gain);
  json["strength"] = finding.strength;
  json["p_value"] = finding.p_value;
  json["could_also_be"] = causes_json(finding.could_also_be);
  json["whole"] = finding.whole;
  json["action"] = finding.action;
  return json;
}

ordered_json findings_json(const Diagnosis& diagnosis) {
  ordered_json list = ordered_json::array();
  for (const Finding& finding : diagnosis.findings) list.push_back(finding_json(finding));
  return list;
}

ordered_json unexplained_json(const Unexplained& unexplained) {
  return {{"present", unexplained.present},
          {"depends_on", unexplained.depends_on},
          {"rms_mm", to_mm(unexplained.rms)},
          {"p_value", unexplained.p_value},
          {"hint", unexplained.hint}};
}

ordered_json not_separable_json(const std::vector<Inseparable>& groups) {
  ordered_json list = ordered_json::array();
  for (const Inseparable& group : groups) {
    ordered_json names = ordered_json::array();
    for (const Cause& cause : group.causes) names.push_back(to_string(cause));
    list.push_back(names);
  }
  return list;
}

ordered_json unseen_json(const Diagnosis& diagnosis) {
  ordered_json list = ordered_json::array();
  for (const Unseen& one : diagnosis.could_not_have_seen) {
    ordered_json json = cause_json(one.cause);
    json["needs"] = one.needs;
    json["smallest_mm"] = length_json(one.detectable);
    json["smallest_named_mm"] = length_json(one.identifiable);
    json["share_of_its_own"] = one.outside;
    json["looked_for_by_order"] = is_looked_for_by_order(one, diagnosis.batch);
    list.push_back(json);
  }
  return list;
}

ordered_json put_in_json(const PutIn& size) {
  return {{"effect_rms_mm", to_mm(size.effect_rms)},
          {"tried", size.tried},
          {"found", size.found},
          {"named", size.named},
          {"misnamed", size.misnamed}};
}

ordered_json proof_json(const Proof& proof) {
  ordered_json causes = ordered_json::array();
  for (const ProvedCause& one : proof.causes) {
    ordered_json json = cause_json(one.cause);
    json["outcome"] = one.never ? "never_named" : one.is_proved() ? "proved" : "open";
    json["predicted_mm"] = length_json(one.predicted);
    json["smallest_mm"] = length_json(one.smallest);
    json["smallest_95_mm"] = {length_json(one.from), length_json(one.to)};
    json["sizes"] = ordered_json::array();
    for (const PutIn& size : one.sizes) json["sizes"].push_back(put_in_json(size));
    causes.push_back(std::move(json));
  }
  return {{"named_share", kProvedShare},
          {"nothing_put_in", put_in_json(proof.healthy)},
          {"refused", proof.refused},
          {"causes", causes}};
}

ordered_json suspects_json(const std::vector<SuspectedPose>& suspects) {
  ordered_json list = ordered_json::array();
  for (const SuspectedPose& pose : suspects) {
    list.push_back({{"pose_id", pose.pose_id},
                    {"row", pose.row},
                    {"distance_mm", to_mm(pose.distance)},
                    {"held_out", pose.held_out},
                    {"reason", pose.reason}});
  }
  return list;
}

JointType type_of(const Diagnosis& diagnosis, Eigen::Index joint) {
  const auto& types = diagnosis.batch.joint_types;
  const auto j = static_cast<std::size_t>(joint);
  return j < types.size() ? types[j] : JointType::kRevolute;
}

ordered_json next_poses_json(const Diagnosis& diagnosis) {
  ordered_json list = ordered_json::array();
  for (const JointVector& q : diagnosis.next_poses.q) {
    ordered_json pose = ordered_json::array();
    for (Eigen::Index j = 0; j < q.size(); ++j)
      pose.push_back(joint_to_column(q(j), type_of(diagnosis, j)));
    list.push_back(pose);
  }
  return list;
}

/// The purpose and the worth of the next poses.
ordered_json next_poses_worth_json(const Diagnosis& diagnosis) {
  const NextPoses& next = diagnosis.next_poses;
  ordered_json columns = ordered_json::array();
  const Eigen::Index joints = next.q.empty() ? 0 : next.q.front().size();
  for (Eigen::Index j = 0; j < joints; ++j) {
    columns.push_back(joint_column(static_cast<int>(j), type_of(diagnosis, j)));
  }
  return {{"columns", columns},
          {"none_because", next.none_because},
          {"separate", causes_json(next.separates)},
          {"stddev_now", next.stddev_now},
          {"stddev_expected", next.stddev_expected},
          {"stddev_random", next.stddev_random}};
}

ordered_json leftover_json(const std::vector<Dependence>& leftover) {
  ordered_json list = ordered_json::array();
  for (const Dependence& one : leftover) {
    list.push_back(
        {{"on", one.on}, {"of", one.of_size ? "size" : "residual"}, {"p_value", one.p_value}});
  }
  return list;
}

ordered_json waterfall_json(const std::vector<WaterfallStep>& steps) {
  ordered_json list = ordered_json::array();
  for (const WaterfallStep& step : steps)
    list.push_back({{"step", step.name}, {"rms_mm", to_mm(step.rms)}});
  return list;
}

/// The notes of both, each once.
std::vector<Note> together(std::vector<Note> notes, const std::vector<Note>& more) {
  for (const Note& note : more) {
    const bool is_there = std::any_of(notes.begin(), notes.end(),
                                      [&](const Note& known) { return known.text == note.text; });
    if (!is_there) notes.push_back(note);
  }
  return gravest_first(std::move(notes));
}

}  // namespace

ordered_json diagnosis_json(const Diagnosis& diagnosis, const std::vector<Note>& notes) {
  return {{"verdict", to_string(diagnosis.verdict)},
          {"sentence", diagnosis.sentence},
          {"poses", diagnosis.poses},
          {"noise_mm", to_mm(diagnosis.noise)},
          {"noise_from", diagnosis.noise_from},
          {"instrument_mm", to_mm(diagnosis.instrument)},
          {"before", figures_json(diagnosis.before)},
          {"after", figures_json(diagnosis.after)},
          {"held_out",
           {{"before", figures_or_null(diagnosis.held_out_before)},
            {"after", figures_or_null(diagnosis.held_out_after)},
            {"before_without_suspects", figures_or_null(diagnosis.held_out_before_without)},
            {"after_without_suspects", figures_or_null(diagnosis.held_out_after_without)},
            {"how", diagnosis.held_out_how}}},
          {"findings", findings_json(diagnosis)},
          {"between_sessions", session_changes_json(diagnosis.between_sessions)},
          {"unexplained", unexplained_json(diagnosis.unexplained)},
          {"not_separable", not_separable_json(diagnosis.not_separable)},
          {"could_not_have_seen", unseen_json(diagnosis)},
          {"suspect_poses", suspects_json(diagnosis.suspects)},
          {"next_poses", next_poses_json(diagnosis)},
          {"next_poses_for", next_poses_worth_json(diagnosis)},
          {"leftover", leftover_json(diagnosis.leftover)},
          {"proof", diagnosis.proof ? proof_json(*diagnosis.proof) : ordered_json(nullptr)},
          {"limits", diagnosis.limits},
          {"budget", diagnosis.budget ? budget_json(*diagnosis.budget) : ordered_json(nullptr)},
          {"notes", notes_json(together(diagnosis.notes, notes))},
          {"waterfall", waterfall_json(diagnosis.waterfall)},
          {"error_sources_before", diagnosis.sources_before},
          {"error_sources_after", diagnosis.sources_after},
          {"batch", diagnosis.batch.id},
          {"batch_hash", diagnosis.batch_hash},
          {"cell_hash", diagnosis.cell_hash},
          {"seed", diagnosis.seed}};
}

}  // namespace trammel
