#pragma once

#include <cmath>
#include <random>

#include "server/base/units.h"
#include "server/diagnose/diagnosis.h"
#include "server/plan/plan.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

/// A diagnosis made by hand: what a page or a table must be able to show, without the minutes of
/// finding it.
namespace trammel::test {

constexpr double kGearOrder = 48.5;  // cycles a turn of joint 3

/// 150 poses of cell-7 with time, temperature and side of approach.
inline MeasurementBatch made_up_batch(const Cell& cell) {
  const Eigen::MatrixXd q = demand(plan_poses(cell, {150, 3}));
  MeasurementBatch batch;
  batch.id = "made-up <1>";
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    Measurement m;
    m.pose_id = fmt::format("p{}", i + 1);
    m.row = static_cast<int>(i) + 2;
    m.context.q = q.row(i).transpose();
    m.context.index = static_cast<int>(i);
    m.context.time = 20.0 * static_cast<double>(i);
    m.context.temperature = 21 + 4 * (1 - std::exp(-static_cast<double>(i) / 60));
    m.context.direction.assign(6, i % 2 == 0 ? 1 : -1);
    m.context.tool = "spindle";
    m.context.payload = "spindle";
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

/// A gear's oscillation of 60 um rms beside noise before, noise alone after.
inline void add_residuals(Diagnosis& diagnosis, const Cell& cell) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0, diagnosis.noise);
  const auto n = static_cast<Eigen::Index>(diagnosis.batch.measurements.size());
  diagnosis.residual_after_B = Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return noise(random); });
  diagnosis.residual_before_B = diagnosis.residual_after_B;
  for (Eigen::Index i = 0; i < n; ++i) {
    const JointVector& q = diagnosis.batch.measurements[static_cast<std::size_t>(i)].context.q;
    const double angle = 5e-5 * std::sin(kGearOrder * q(2) + 0.4);
    diagnosis.residual_before_B.col(i) +=
        cell.robot.jacobian(q, cell.tools.at("spindle")->translation()).col(2).head<3>() * angle;
  }
  diagnosis.before = figures_of(diagnosis.residual_before_B);
  diagnosis.after = figures_of(diagnosis.residual_after_B);
  diagnosis.held_out_before = diagnosis.before;
  diagnosis.held_out_after = diagnosis.after;
  diagnosis.held_out_how = "8 blocks, each predicted from the others";
}

inline std::vector<Periodogram> made_up_periodograms() {
  std::vector<Periodogram> all;
  for (int joint = 0; joint < 6; ++joint) {
    Periodogram one{joint, Eigen::VectorXd::LinSpaced(4000, 0.5, 120), Eigen::VectorXd::Zero(4000),
                    28};
    for (Eigen::Index k = 0; k < one.order.size(); ++k) {
      one.strength(k) = 4 + 3 * std::sin(0.7 * static_cast<double>(k * (joint + 1)));
      if (joint == 2)
        one.strength(k) += 220 * std::exp(-std::pow((one.order(k) - kGearOrder) / 0.4, 2));
    }
    all.push_back(std::move(one));
  }
  return all;
}

inline std::vector<Finding> made_up_findings(const Diagnosis& diagnosis) {
  Finding gear;
  gear.cause = {"gear_transmission", 2, "", "", kGearOrder};
  gear.source = "gear_transmission:3@48.5";
  gear.parameters = {{"order", "cycles a turn", 48.503, 0.04},
                     {"amplitude", "arcsec", 10.31, 0.52},
                     {"gear_sin3", "rad", 5e-5 * std::cos(0.4), 2e-6},
                     {"gear_cos3", "rad", 5e-5 * std::sin(0.4), 2e-6}};
  gear.effect_rms = 58e-6;
  gear.held_out_before = diagnosis.before;
  gear.held_out_after = diagnosis.after;
  gear.held_out_gain = diagnosis.before.rms - diagnosis.after.rms;
  gear.strength = 214;
  gear.p_value = 0.0025;
  gear.action = "Have the gear of joint 3 looked at; its error repeats 48.5 times a turn.";
  Finding tool;
  tool.cause = {"tool", -1, "", "", std::nullopt};
  tool.source = "tool";
  tool.parameters = {{"tz", "mm", 0.0812, 0.011}};
  tool.effect_rms = 21e-6;
  tool.held_out_before = diagnosis.after;
  tool.held_out_after = diagnosis.after;
  tool.strength = 41;
  tool.p_value = 0.005;
  tool.naming_frequency = 0.55;
  tool.could_also_be = {{"geometry", -1, "d6", "", std::nullopt}};
  tool.action = "Measure the next poses before anything is changed.";
  return {gear, tool};
}

/// A cause that is proved, one that no size names, and one that is not decided yet.
inline Proof made_up_proof() {
  return {.causes = {{.cause = {"gear_transmission", 2},
                      .sizes = {{10e-6, 4, 1, 0, 1}, {20e-6, 8, 8, 6, 0}, {40e-6, 6, 6, 6, 0}},
                      .predicted = 24e-6,
                      .smallest = 27e-6,
                      .from = 24e-6,
                      .to = 31e-6},
                     {.cause = {"tool"}, .sizes = {{90e-6, 9, 9, 0, 0}}, .never = true},
                     {.cause = {"backlash", 1},
                      .sizes = {{15e-6, 1, 0, 0, 0}},
                      .predicted = 12e-6,
                      .smallest = 21e-6,
                      .from = 9e-6}},
          .healthy = {0, 12, 1, 0, 1},
          .refused = 2};
}

inline Diagnosis made_up_diagnosis(const std::shared_ptr<const Cell>& cell) {
  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kAmbiguous;
  diagnosis.sentence =
      "The gear of joint 3 oscillates 48.5 times a turn (58 µm rms): certain. Besides, the tool or "
      "the last link is longer than the cell file says: these poses do not tell which.";
  diagnosis.batch = made_up_batch(*cell);
  diagnosis.poses = static_cast<int>(diagnosis.batch.measurements.size());
  diagnosis.noise = 13e-6;
  diagnosis.instrument = 10e-6;
  diagnosis.noise_from = "the tracker";
  add_residuals(diagnosis, *cell);
  diagnosis.findings = made_up_findings(diagnosis);
  diagnosis.unexplained = {true, {"q4"}, 9e-6, 0.004};
  diagnosis.not_separable = {{{{"tool"}, {"geometry", -1, "d6", "", {}}}, 0.998}};
  diagnosis.could_not_have_seen = {
      {{"thermal_growth"}, 0.12, 44e-6, 90e-6, "a wider range of temperature"},
      {{"backlash", 1}, 0, {}, {}, "both approach directions"},
      {{"joint_slip", 3}, 0.8, 12e-6, 16e-6, ""}};
  diagnosis.suspects = {
      {"p28", 29, 310e-6, "single pose, cause not separable: repeat it and its neighbours"}};
  for (Eigen::Index i = 0; i < 10; ++i) {
    diagnosis.next_poses.q.push_back(
        diagnosis.batch.measurements[static_cast<std::size_t>(3 * i)].context.q);
  }
  diagnosis.next_poses.separates = diagnosis.not_separable.front().causes;
  diagnosis.next_poses.stddev_now = 2.4;
  diagnosis.next_poses.stddev_expected = 0.3;
  diagnosis.next_poses.stddev_random = 0.9;
  diagnosis.leftover = {{"q4", false, 0.004}, {"torque", true, 0.2}, {"time", false, 1}};
  diagnosis.limits = {
      "The batch has one payload: an error of its mass cannot be told from the compliances."};
  diagnosis.periodograms = made_up_periodograms();
  diagnosis.waterfall = {{"measured", 4.21e-3},
                         {"base", 412e-6},
                         {"geometry", 131e-6},
                         {"compliance", diagnosis.before.rms},
                         {"gear transmission 3", 31e-6},
                         {"tool", diagnosis.after.rms},
                         {"noise of one measurement", 22e-6}};
  diagnosis.recovery = {{{"gear_transmission", 2},
                         Eigen::Vector4d(5e-6, 10e-6, 20e-6, 40e-6),
                         Eigen::Vector4d(0, .4, .9, 1)},
                        {{"backlash", 1},
                         Eigen::Vector4d(5e-6, 10e-6, 20e-6, 40e-6),
                         Eigen::Vector4d(0, .1, .7, .95)}};
  diagnosis.sources_before = {"base", "geometry", "compliance"};
  diagnosis.sources_after = {"base", "geometry", "compliance", "gear_transmission:3@48.5"};
  diagnosis.batch_hash = std::string(64, 'a');
  diagnosis.cell_hash = std::string(64, 'b');
  diagnosis.seed = 1;
  return diagnosis;
}

}  // namespace trammel::test
