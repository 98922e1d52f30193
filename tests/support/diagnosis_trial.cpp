#include "tests/support/diagnosis_trial.h"

#include <algorithm>
#include <chrono>

#include "server/base/units.h"
#include "server/measurement/measurement.h"
#include "tests/support/from_rows.h"
#include "tests/support/hidden_oracle.h"

namespace trammel::test {

namespace {

using hidden::HiddenCase;
using hidden::HiddenCause;

constexpr int kRandomDraws = 8;  // of ten poses each

std::string text_of(const hidden::HiddenTruth& truth) {
  std::string text;
  for (const HiddenCause& cause : truth.causes)
    text += (text.empty() ? "" : " + ") + to_string(cause);
  return text.empty() ? "nothing" : text;
}

/// The hidden simulation's word for a named cause.
HiddenCause as_hidden(const Cause& cause, int poses) {
  HiddenCause hidden{cause.cause, cause.joint + 1,        cause.parameter, -1,
                     {},          cause.order.value_or(0)};
  if (!cause.pose_id.empty())
    hidden.first = std::clamp(std::stoi(cause.pose_id.substr(1)) - 1, 0, poses - 1);
  if (hidden.cause == "compliance" && hidden.parameter.empty())
    hidden.parameter = "C" + std::to_string(hidden.joint);
  return hidden;
}

std::vector<hidden::MeasuringPose> as_poses(const std::vector<JointVector>& joints,
                                            int first_index) {
  std::vector<hidden::MeasuringPose> poses;
  for (const JointVector& q : joints) {
    hidden::MeasuringPose pose;
    pose.index = first_index + static_cast<int>(poses.size());
    pose.q = q;
    poses.push_back(pose);
  }
  return poses;
}

/// True if the hidden simulation can make the cause without further data.
bool can_be_made(const HiddenCause& cause) {
  if (cause.cause == "geometry" || cause.cause == "compliance") {
    const auto& all = hidden::arm_parameters();
    return std::any_of(all.begin(), all.end(),
                       [&](const auto& known) { return known.name == cause.parameter; });
  }
  if (cause.cause == "gear_transmission") return cause.order > 0;
  return cause.cause != "joint_map" && cause.cause != "outlier";
}

/// The causes that are named besides the truth.
std::vector<HiddenCause> confounded_with(const Diagnosis& diagnosis, const HiddenCause& truth,
                                         int poses) {
  std::vector<HiddenCause> others;
  for (const Cause& cause : diagnosis.next_poses.separates) {
    const HiddenCause other = as_hidden(cause, poses);
    const bool is_truth = other.cause == truth.cause &&
                          (truth.joint == 0 || other.joint == truth.joint) &&
                          (truth.parameter.empty() || other.parameter == truth.parameter);
    if (!is_truth && can_be_made(other)) others.push_back(other);
  }
  return others;
}

void compare_next_poses(const Diagnosis& diagnosis, const HiddenCase& hidden, TrialResult& result) {
  const NextPoses& next = diagnosis.next_poses;
  if (next.q.empty() || hidden.truth.causes.size() != 1) return;
  result.next_poses_claimed = {next.stddev_now, next.stddev_expected, next.stddev_random};
  const auto count = static_cast<int>(hidden.world.poses.size());
  const std::vector<HiddenCause> rivals =
      confounded_with(diagnosis, hidden.truth.causes.front(), count);
  if (rivals.empty()) return;
  NextPosesWorth worth{relative_stddev(hidden, rivals, {}),
                       relative_stddev(hidden, rivals, as_poses(next.q, count)), 0};
  hidden::Random random(hidden.world.poses.size() + 17);
  for (int draw = 0; draw < kRandomDraws; ++draw) {
    std::vector<hidden::MeasuringPose> poses = hidden::draw_poses(
        {.count = static_cast<int>(next.q.size()), .ranges = hidden.cell_ranges}, random);
    for (hidden::MeasuringPose& pose : poses) pose.index += count;
    worth.random += relative_stddev(hidden, rivals, poses) / kRandomDraws;
  }
  result.next_poses_measured = worth;
}

/// The closest imitator with at most as many numbers as the truth: a richer one must be rejected
/// for its numbers.
void find_rival(const HiddenCase& hidden, TrialResult& result) {
  for (const hidden::Rival& rival : closest_rivals(hidden)) {
    if (rival.values > hidden.world.effects.front().values.size()) continue;
    result.beside_rival = rival.left * hidden.truth.lambdas.front();
    result.rival = to_string(rival.cause);
    return;
  }
}

std::string told(const Finding& finding) {
  std::string text = fmt::format(
      "  {} {} from {}: effect {:.4f} mm, lambda {:.1f}, p {:.4g}, naming {:.2f}, held out {:.4f} "
      "-> {:.4f}\n",
      to_string(finding.cause), finding.source, finding.cause.pose_id, to_mm(finding.effect_rms),
      finding.strength, finding.p_value, finding.naming_frequency,
      to_mm(finding.held_out_before.rms), to_mm(finding.held_out_after.rms));
  for (const Estimate& estimate : finding.parameters) {
    text += fmt::format("    {} = {:.6g} +- {:.2g} {}\n", estimate.name, estimate.value,
                        estimate.u95, estimate.unit);
  }
  for (const Cause& cause : finding.could_also_be)
    text += fmt::format("    could also be {}\n", to_string(cause));
  return text;
}

}  // namespace

Result<Diagnosis> diagnose_files(const HiddenCase& hidden, const DiagnoseOptions& options) {
  const Result<Cell> cell = parse_cell(hidden.cell_yaml, hidden.robot_yaml, "cell.yaml");
  if (!cell) return tl::make_unexpected(cell.error());
  const Result<MeasurementBatch> batch = parse_batch_csv(hidden.batch_csv, "batch.csv");
  if (!batch) return tl::make_unexpected(batch.error());
  return diagnose(std::make_shared<const Cell>(*cell), *batch, options);
}

TrialResult run_trial(const Trial& trial, const DiagnoseOptions& options) {
  const HiddenCase hidden = hidden::hide(trial.spec);
  TrialResult result;
  result.trial = trial;
  result.truth = text_of(hidden.truth);
  const auto begin = std::chrono::steady_clock::now();
  const Result<Diagnosis> diagnosis = diagnose_files(hidden, options);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!diagnosis) {
    result.error = diagnosis.error().message;
    result.judgement.said = "refused";
    return result;
  }
  result.judgement = judge(*diagnosis, hidden);
  if (diagnosis->held_out_before)
    result.held_out_before_mm = to_mm(diagnosis->held_out_before->rms);
  if (diagnosis->held_out_after) result.held_out_after_mm = to_mm(diagnosis->held_out_after->rms);
  if (trial.compare_with_oracle) result.oracle_mm = held_out_rms_mm(hidden);
  if (trial.compare_next_poses) compare_next_poses(*diagnosis, hidden, result);
  if (hidden.truth.question == hidden::Question::kName && hidden.truth.causes.size() == 1)
    find_rival(hidden, result);
  return result;
}

std::string told(const Diagnosis& diagnosis) {
  std::string text = fmt::format(
      "{}: {}\n{} poses, noise {:.4f} mm from {}; rms {:.4f} -> {:.4f} mm\n",
      to_string(diagnosis.verdict), diagnosis.sentence, diagnosis.poses, to_mm(diagnosis.noise),
      diagnosis.noise_from, to_mm(diagnosis.before.rms), to_mm(diagnosis.after.rms));
  if (diagnosis.held_out_before && diagnosis.held_out_after) {
    text +=
        fmt::format("held out ({}): {:.4f} -> {:.4f} mm\n", diagnosis.held_out_how,
                    to_mm(diagnosis.held_out_before->rms), to_mm(diagnosis.held_out_after->rms));
  }
  for (const Finding& finding : diagnosis.findings) text += told(finding);
  if (diagnosis.unexplained.present) {
    text += "unexplained:";
    for (const std::string& on : diagnosis.unexplained.depends_on) text += " " + on;
    text += fmt::format(", {:.4f} mm rms, p {:.4g}\n", to_mm(diagnosis.unexplained.rms),
                        diagnosis.unexplained.p_value);
  }
  for (const Inseparable& set : diagnosis.not_separable) {
    text += fmt::format("not separable ({:.3f}):", set.correlation);
    for (const Cause& cause : set.causes) text += " " + to_string(cause);
    text += "\n";
  }
  for (const Unseen& unseen : diagnosis.could_not_have_seen) {
    const auto size = [](const std::optional<double>& least) {
      return least ? fmt::format("from {:.4f} mm", to_mm(*least)) : std::string("never");
    };
    text += fmt::format("{} (outside {:.3f}) is noticed {}, named {}; needs: {}\n",
                        to_string(unseen.cause), unseen.outside, size(unseen.detectable),
                        size(unseen.identifiable), unseen.needs);
  }
  for (const SuspectedPose& pose : diagnosis.suspects) {
    text += fmt::format("suspect pose {}: {:.3f} mm, {}\n", pose.pose_id, to_mm(pose.distance),
                        pose.reason);
  }
  text += fmt::format("next poses: {}, stddev now {:.3f}, expected {:.3f}, random {:.3f}\n",
                      diagnosis.next_poses.q.size(), diagnosis.next_poses.stddev_now,
                      diagnosis.next_poses.stddev_expected, diagnosis.next_poses.stddev_random);
  for (const std::string& limit : diagnosis.limits) text += "limit: " + limit + "\n";
  return text;
}

}  // namespace trammel::test
