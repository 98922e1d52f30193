#include "server/report/health_json.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/model_notes.h"
#include "server/report/budget_json.h"
#include "server/report/figures_json.h"
#include "server/report/note_json.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kShownSizes = 5;    // for people: the sizes that are hardest to see
constexpr std::size_t kShownChanges = 6;  // for people: of the changes

/// The measurements of a check and the model that they were held against.
struct CheckedWith {
  const CheckedBatch& batch;
  const CompensatedModel& model;
};

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
      json["zeros"].push_back({{"joint", zero.joint + 1},
                               {"deg", to_deg(zero.by)},
                               {"u95_deg", to_deg(zero.u95)},
                               {"effect_rms_mm", to_mm(zero.effect_rms)},
                               {"effect_u95_mm", to_mm(zero.effect_u95)}});
  }
  json["p_value"] = change.p_value;
  json["since"] = {{"session_id", since.session_id}, {"pose_id", since.pose_id}};
  json["could_also_be"] = ordered_json::array();
  for (const SingleCause& other : change.could_also_be)
    json["could_also_be"].push_back(cause_json(other));
  return json;
}

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// A line of a budget with the values that a check knows. It lacks the ratio to the usual size and
/// the error that would remain.
BudgetLine change_line(std::string line, LineKind kind, int joint, std::string name) {
  BudgetLine change;
  change.line = std::move(line);
  change.kind = kind;
  change.joint = joint;
  change.name = std::move(name);
  for (double* unknown :
       {&change.alone_rms, &change.alone_max, &change.share, &change.left_if_right})
    *unknown = kNotKnown;
  return change;
}

/// `zero:4`, `length:6`, `twist:2`, `compliance:3`; otherwise the cause, and its joint if it has
/// one.
BudgetLine line_of(const SingleCause& cause) {
  const CauseRecord& record = *cause.record;
  const std::string name = in_words(cause);
  const std::size_t digits = cause.parameter.find_first_of("0123456789");
  if (record.part == causes::Part::kLinks && digits != std::string::npos) {
    const std::string letters = cause.parameter.substr(0, digits),
                      number = cause.parameter.substr(digits);
    const int joint = std::stoi(number) - 1;
    if (letters == "q") return change_line("zero:" + number, LineKind::kJointZero, joint, name);
    if (letters == "d" || letters == "a")
      return change_line("length:" + number, LineKind::kLength, joint, name);
    return change_line("twist:" + number, LineKind::kTwist, joint, name);
  }
  const std::string spelling(record.spelling);
  const std::string of_joint = cause.joint < 0 ? "" : ":" + std::to_string(cause.joint + 1);
  if (cause.joint >= 0 && record.search == causes::SearchFamily::kZeroStep && !cause.any_function)
    return change_line("zero" + of_joint, LineKind::kJointZero, cause.joint, name);
  const bool is_gearbox = record.gives_way && record.numbers == causes::Numbers::kOneAJoint;
  BudgetLine line =
      change_line(spelling + of_joint,
                  is_gearbox && cause.joint >= 0 ? LineKind::kJointCompliance : LineKind::kCause,
                  cause.joint, name);
  line.cause = spelling;
  return line;
}

/// The lines of a check, each with its size (m rms) for the order.
using SizedLines = std::vector<std::pair<double, BudgetLine>>;

/// Adds a line for each zero. With several zeros, the effect of each alone is known at the poses of
/// the check.
void add_zero_lines(const SeenChange& change, const CheckedWith* with, SizedLines& lines) {
  for (const LostZero& zero : change.zeros) {
    const std::string n = std::to_string(zero.joint + 1);
    BudgetLine line =
        change_line("zero:" + n, LineKind::kJointZero, zero.joint, "the zero of joint " + n);
    line.value = BudgetNumber{"q" + n, to_deg(zero.by), to_deg(zero.u95), "deg"};
    if (change.zeros.size() == 1) {
      line.alone_rms = change.effect_rms;
    } else if (with != nullptr) {
      line.alone_rms = alone_of_zero(with->model, zero.joint, zero.by, with->batch.rows());
    }
    for (const LostZero& other : change.zeros)
      if (other.joint != zero.joint) line.with.push_back("zero:" + std::to_string(other.joint + 1));
    line.action = "re-master joint " + n;
    lines.emplace_back(std::isfinite(line.alone_rms) ? line.alone_rms : change.effect_rms,
                       std::move(line));
  }
}

void add_line(const SeenChange& change, SizedLines& lines) {
  BudgetLine line = line_of(change.cause);
  line.alone_rms = change.effect_rms;
  for (const SingleCause& other : change.could_also_be) line.with.push_back(line_of(other).line);
  line.action = change.cause.record->action;
  lines.emplace_back(change.effect_rms, std::move(line));
}

/// The change since the model was made, in the form of a budget: from the present error to that of
/// a healthy robot. A check locates the base anew, so all of it is beyond the base's frame.
ordered_json change_budget_json(const HealthCheck& check, const CheckedWith* with) {
  SizedLines sized;
  for (const SeenChange& change : check.changed) {
    if (change.zeros.empty()) {
      add_line(change, sized);
    } else {
      add_zero_lines(change, with, sized);
    }
  }
  const auto by_size = [](const auto& a, const auto& b) { return a.first > b.first; };
  std::stable_sort(sized.begin(), sized.end(), by_size);
  std::vector<std::string> sentences;
  for (const auto& [size, line] : sized)
    if (sentences.size() < kShownChanges) sentences.push_back(sentence(line));
  BudgetLine rest = change_line("rest", LineKind::kRest, -1, "what a healthy robot leaves");
  rest.alone_rms = check.expected_rms;
  sized.emplace_back(check.expected_rms, std::move(rest));
  std::stable_sort(sized.begin(), sized.end(), by_size);
  ordered_json lines = ordered_json::array();
  for (const auto& [size, line] : sized) lines.push_back(budget_line_json(line));
  ordered_json beyond_frames = {{"nominal_rms_mm", to_mm(check.rms)}, {"lines", lines}};
  return {{"nominal_rms_mm", to_mm(check.rms)},
          {"poses", check.poses},
          {"lines", std::move(lines)},
          {"beyond_frames", std::move(beyond_frames)},
          {"sentences", std::move(sentences)}};
}

/// mm to a nanometre: no instrument sees less.
ordered_json rounded_mm(const Vector3& v) {
  const auto rounded = [](double m) { return std::round(to_mm(m) * 1e6) / 1e6; };
  return {rounded(v.x()), rounded(v.y()), rounded(v.z())};
}

ordered_json pose_json(const PoseAtCheck& pose) {
  return {{"pose_id", pose.pose_id},
          {"xyz_mm", rounded_mm(pose.place_B)},
          {"off_mm", rounded_mm(pose.off_B)},
          {"expected_mm", to_mm(pose.expected)},
          {"suspect", pose.suspect}};
}

constexpr double kMonth = 30 * 86400.0;  // s

ordered_json drift_json(const DriftSeen& drift) {
  ordered_json misfits = ordered_json::array();
  for (const double misfit : drift.misfit) misfits.push_back(std::round(misfit * 1e3) / 1e3);
  return {
      {"from_unix_s", drift.from}, {"until_unix_s", drift.until}, {"misfit", std::move(misfits)}};
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
  if (!json.is_object() || !json.contains("drift_seen") || !json["drift_seen"].is_object())
    return std::nullopt;
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

namespace {

ordered_json health_json(const HealthCheck& check, const CheckedSince& since,
                         const CheckedWith* with) {
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
  for (const SeenChange& change : check.changed)
    json["changed"].push_back(change_json(change, since));
  json["budget"] = change_budget_json(check, with);
  json["at_poses"] = ordered_json::array();
  for (const PoseAtCheck& pose : check.at_poses) json["at_poses"].push_back(pose_json(pose));
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

}  // namespace

ordered_json health_json(const HealthCheck& check, const CheckedSince& since) {
  return health_json(check, since, nullptr);
}

ordered_json check_json(const HealthCheck& check, const CheckedBatch& batch,
                        const CompensatedModel& model) {
  const auto& rows = batch.rows().measurements;
  const CheckedWith with{batch, model};
  ordered_json json =
      health_json(check, {batch.id(), rows.empty() ? "" : rows.front().pose_id}, &with);
  json["notes"] = notes_json(notes_of(model));
  return json;
}

std::string health_text(const HealthCheck& check) {
  std::string text = fmt::format("{}: {}\n{} poses: {:.4f} mm rms, a healthy robot has {:.4f}\n",
                                 to_string(check.verdict), check.sentence, check.poses,
                                 to_mm(check.rms), to_mm(check.expected_rms));
  if (!check.smallest.empty())
    text += "hardest to see (mm rms over the working poses, seen with 95 %):\n";
  for (std::size_t i = 0; i < std::min(kShownSizes, check.smallest.size()); ++i) {
    const SmallestEffect& one = check.smallest[i];
    text += fmt::format("  {:34} {}\n", in_words(one.cause),
                        one.rms ? fmt::format("{:.3f}", to_mm(*one.rms)) : "never");
  }
  if (!check.due.empty() || !check.due_because.empty())
    text += fmt::format("next check: {}{}{}\n", check.due, check.due.empty() ? "" : "; ",
                        check.due_because);
  return text;
}

}  // namespace trammel
