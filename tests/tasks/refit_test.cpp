#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/measurement/checked_batch.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

using Parts = CompensatedModel::Parts;

/// A tracker that was set up elsewhere.
Pose set_up_elsewhere() { return make_pose(rotation_exp({0, 0, from_deg(20)}), {0.5, -0.4, 0.3}); }

MeasurementBatch seen_from(const Pose& moved, MeasurementBatch batch, const std::string& id) {
  for (Measurement& m : batch.measurements) {
    m.p_W = moved * m.p_W;
    if (m.R_WT) m.R_WT = (moved.linear() * *m.R_WT).eval();
  }
  batch.id = id;
  batch.source_text.clear();
  return batch;
}

/// As a shop floor measures a base: a reflector at a few places, the wrist never turned.
MeasurementBatch at_one_wrist(const VirtualRobot& robot, int poses, std::uint64_t seed) {
  Eigen::MatrixXd q = test::demand(plan_poses(*robot.truth.cell, {.count = poses, .seed = seed}));
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    // Joints 2, 3 and 5 turn about parallel axes: the tool keeps its inclination; joint 1 turns it
    // about the vertical.
    q.row(i).tail<3>() << 0, 0.4 - 0.5 * q(i, 1), 0;
    q(i, 2) = -0.5 * q(i, 1);
  }
  SimulateOptions options;
  options.seed = seed;
  options.orientation = false;
  return test::demand(simulate(robot, q, options));
}

CompensatedModel trained(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                         const std::string& level, const std::string& bias) {
  TrainOptions options;
  options.level = level;
  options.bias = bias;
  return test::demand(train(cell, batch, options));
}

TrainOptions from(const CompensatedModel& model, const std::vector<std::string>& refit) {
  TrainOptions options;
  options.from = model;
  options.refit = refit;
  return options;
}

/// Indices of the parameters of all sources but `refitted`.
std::vector<Eigen::Index> kept_parameters(const PhysicalModel& model, const std::string& refitted) {
  std::vector<Eigen::Index> kept;
  Eigen::Index k = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    for (std::size_t i = 0; i < source->parameters().size(); ++i, ++k) {
      if (source->name() != refitted) kept.push_back(k);
    }
  }
  return kept;
}

void expect_same_bias(const Parts& now, const Parts& before) {
  ASSERT_EQ(now.bias.has_value(), before.bias.has_value());
  if (!now.bias) return;
  EXPECT_EQ(now.bias->kernel, before.bias->kernel);
  EXPECT_EQ(now.bias->q, before.bias->q);
  EXPECT_EQ(now.bias->residual_B, before.bias->residual_B);
  EXPECT_EQ(now.bias->hyperparameters, before.bias->hyperparameters);
  EXPECT_EQ(now.bias->block_hyperparameters, before.bias->block_hyperparameters);
  EXPECT_EQ(now.rotation_bias.has_value(), before.rotation_bias.has_value());
  EXPECT_EQ(now.bias_contexts.size(), before.bias_contexts.size());
}

/// Everything that is not of the source `refitted` is what it was, bit for bit.
void expect_kept(const CompensatedModel& refit, const CompensatedModel& model,
                 const std::string& refitted) {
  const Parts& now = refit.parts();
  const Parts& before = model.parts();
  const std::vector<Eigen::Index> kept = kept_parameters(before.physics, refitted);
  EXPECT_EQ(now.physics.values(kept), before.physics.values(kept));
  EXPECT_EQ(Eigen::MatrixXd(now.covariance(kept, kept)),
            Eigen::MatrixXd(before.covariance(kept, kept)));
  for (const Eigen::Index k : kept) {
    const auto at = static_cast<std::size_t>(k);
    EXPECT_EQ(now.parameters[at].value, before.parameters[at].value);
    EXPECT_EQ(now.parameters[at].stddev, before.parameters[at].stddev);
    EXPECT_EQ(now.parameters[at].identified, before.parameters[at].identified);
  }
  if (refitted != "base") {
    EXPECT_EQ(now.physics.X_WB.matrix(), before.physics.X_WB.matrix());
  }
  if (refitted != "tool") {
    for (const auto& [name, X_FT] : before.physics.tools)
      EXPECT_EQ(now.physics.tools.at(name).matrix(), X_FT.matrix()) << name;
  }
  expect_same_bias(now, before);
  EXPECT_EQ(now.q_min, before.q_min);
  EXPECT_EQ(now.q_max, before.q_max);
  EXPECT_EQ(now.extrapolation_slope, before.extrapolation_slope);
  EXPECT_EQ(now.prior_share_limit, before.prior_share_limit);
  EXPECT_EQ(now.temperature_mean, before.temperature_mean);
  EXPECT_TRUE(std::includes(now.trained_with.begin(), now.trained_with.end(),
                            before.trained_with.begin(), before.trained_with.end()));
  EXPECT_EQ(now.provenance.batch_hash, before.provenance.batch_hash);
  EXPECT_EQ(now.provenance.training_poses, before.provenance.training_poses);
  ASSERT_EQ(now.provenance.refits.size(), before.provenance.refits.size() + 1);
  EXPECT_EQ(now.provenance.refits.back().model, before.provenance.id);
  const CompensatedModel stored = test::demand(deserialize(serialize(refit), "memory"));
  EXPECT_EQ(stored.provenance().hash, refit.provenance().hash);
}

TEST(Refit, ABaseIsFoundFromThreePositionsAndNothingElseMoves) {
  for (const bool located : {true, false}) {
    const auto cell = located ? test::cell_7() : test::cell_7_unlocated();
    const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
    const CompensatedModel model = trained(cell, test::measured(robot, 120, 71), "M2", "se");
    MeasurementBatch three = seen_from(set_up_elsewhere(), at_one_wrist(robot, 3, 72), "three");
    const CompensatedModel refit = test::demand(train(cell, three, from(model, {"base"})));
    expect_kept(refit, model, "base");
    const MeasurementBatch fresh = test::measured(robot, 300, 73);
    const double before = model.evaluate(fresh).compensated.rms;
    const Evaluation after = refit.evaluate(seen_from(set_up_elsewhere(), fresh, "fresh"));
    EXPECT_LT(after.compensated.rms, 2 * before)
        << "each of the three is known no better than that";
    EXPECT_GT(after.coverage_95, 0.9);
  }
}

TEST(Refit, OrientationsOfFewPosesAreHeldAgainstTheToolThatTheModelKnows) {
  const auto cell = test::cell_7_unlocated();
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const CompensatedModel model = trained(cell, test::measured(robot, 120, 90), "M2", "none");
  MeasurementBatch four = seen_from(set_up_elsewhere(), test::measured(robot, 4, 91), "four");
  ASSERT_TRUE(four.measurements.front().R_WT);
  expect_kept(test::demand(train(cell, four, from(model, {"base"}))), model, "base");
  for (Measurement& m : four.measurements) m.R_WT = *m.R_WT * rotation_exp({0, 0, from_deg(30)});
  const auto refused = train(cell, four, from(model, {"base"}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text, "against tool 'spindle'");
  EXPECT_NEAR(refused.error().value.value_or(0), 30, 0.5) << sentence(refused.error());
}

TEST(Refit, ABaseFromTwentyPositionsAtOneWristIsAsGoodAsTheModelItself) {
  const auto cell = test::cell_7_unlocated();
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const CompensatedModel model = trained(cell, test::measured(robot, 120, 74), "M3", "none");
  for (const char* kernel : {"none", "se + parameters"}) {
    const CompensatedModel start = trained(cell, test::measured(robot, 120, 74), "M3", kernel);
    const MeasurementBatch twenty =
        seen_from(set_up_elsewhere(), at_one_wrist(robot, 20, 75), "twenty");
    const CompensatedModel refit = test::demand(train(cell, twenty, from(start, {"base"})));
    expect_kept(refit, start, "base");
    const Evaluation after =
        refit.evaluate(seen_from(set_up_elsewhere(), test::measured(robot, 300, 76), "fresh"));
    EXPECT_LT(to_mm(after.compensated.rms), 0.030) << kernel;
    EXPECT_GT(after.coverage_95, 0.92) << kernel;
  }
}

TEST(Refit, WhatFewPositionsLeaveUncertainOfTheBaseIsPartOfWhatTheModelClaims) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 120, 77), "M3", "none");
  const MeasurementBatch fresh = test::measured(robot, 60, 78);
  double covered = 0;
  double claimed = 0, missed = 0;
  constexpr int kSeeds = 20;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const MeasurementBatch few = at_one_wrist(robot, 4, 100 + static_cast<std::uint64_t>(seed));
    const CompensatedModel refit = test::demand(train(cell, few, from(model, {"base"})));
    const CompensatedModel::LevelErrors errors = refit.errors_B(fresh);
    covered += refit.evaluate(fresh).coverage_95 / kSeeds;
    claimed += errors.stddev.squaredNorm();
    missed += errors.compensated.squaredNorm();
  }
  EXPECT_GT(covered, 0.90);
  EXPECT_LT(claimed, 2 * missed);
}

TEST(Refit, AToolThatTheNewPosesDoNotHaveStaysKnown) {
  auto both = std::make_shared<Cell>(*test::cell_7());
  both->tools["probe"] = make_pose(rotation_exp({0, 0.3, 0}), {0.02, -0.01, 0.31});
  VirtualRobot robot = test::chapter_5_robot(both);
  const auto measured_with = [&](const Pose& knocked, std::uint64_t seed, bool alternate,
                                 int count) {
    VirtualRobot now = robot;
    now.truth.tools["probe"] = knocked * now.truth.tools["probe"];
    const Eigen::MatrixXd joints = test::demand(plan_poses(*both, {.count = count, .seed = seed}));
    std::vector<PoseContext> poses(static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < poses.size(); ++i) {
      poses[i].q = joints.row(static_cast<Eigen::Index>(i)).transpose();
      poses[i].tool = alternate && i % 2 == 0 ? "spindle" : "probe";
      poses[i].payload = "spindle";
    }
    SimulateOptions options;
    options.seed = seed;
    MeasurementBatch made = test::demand(simulate(now, poses, options));
    made.id = fmt::format("of-{}", seed);
    return made;
  };
  const CompensatedModel model =
      trained(both, measured_with(Pose::Identity(), 80, true, 160), "M3,tool", "none");
  const Pose knocked = make_pose(rotation_exp({1e-3, 0, 0}), {1e-3, -0.5e-3, 0.2e-3});
  const CompensatedModel refit =
      test::demand(train(both, measured_with(knocked, 81, false, 20), from(model, {"tool"})));
  EXPECT_TRUE(refit.check_trained_with("spindle", "spindle").has_value());
  EXPECT_TRUE(refit.check_trained_with("probe", "spindle").has_value());
  const std::vector<Parameter> parameters = model.parts().physics.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].name.ends_with("[probe]")) continue;
    const auto at = static_cast<Eigen::Index>(k);
    EXPECT_EQ(refit.parts().physics.values(at), model.parts().physics.values(at))
        << parameters[k].name;
    EXPECT_EQ(refit.parts().covariance(at, at), model.parts().covariance(at, at))
        << parameters[k].name;
  }
  EXPECT_LT(to_mm(refit.evaluate(measured_with(knocked, 82, false, 200)).compensated.rms), 0.028);
}

TEST(Refit, AToolThatIsElsewhereLeavesPosesInTheDomainOfABiasWithParameters) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->tools["spindle"].reset();
  VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const CompensatedModel model =
      trained(cell, test::measured(robot, 120, 92), "M2", "se + parameters");
  const int in_domain = model.evaluate(test::measured(robot, 100, 93)).in_domain;
  robot.truth.tools["spindle"].translation() += Vector3(0.01, -0.005, 0.02);
  const CompensatedModel refit =
      test::demand(train(cell, test::measured(robot, 25, 94), from(model, {"tool"})));
  const Evaluation after = refit.evaluate(test::measured(robot, 100, 93));
  EXPECT_EQ(after.in_domain, in_domain);
  EXPECT_GT(after.coverage_95, 0.9);
  EXPECT_LT(to_mm(after.compensated.rms), 0.035);
}

TEST(Refit, ABiasThatIsNamedIsLearnedAnewAndOneThatIsNotIsKept) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 100, 83), "M2", "se");
  const MeasurementBatch batch =
      seen_from(set_up_elsewhere(), test::measured(robot, 40, 84), "moved");
  TrainOptions options = from(model, {"base"});
  expect_kept(test::demand(train(cell, batch, options)), model, "base");
  options.bias = "matern52";
  const CompensatedModel anew = test::demand(train(cell, batch, options));
  EXPECT_EQ(anew.parts().bias->kernel, "matern52");
  EXPECT_EQ(anew.parts().bias->q.rows(), 40);
  EXPECT_NE(anew.parts().q_min, model.parts().q_min);
  options.bias = "none";
  const CompensatedModel without = test::demand(train(cell, batch, options));
  EXPECT_FALSE(without.parts().bias);
  EXPECT_EQ(without.parts().q_min, model.parts().q_min);
}

TEST(Refit, AModelFileWhoseBiasWasLearnedNowhereIsRefusedThoughItsHashFits) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model =
      trained(cell, test::measured(robot, 40, 83), "M2", "se + parameters");
  const MeasurementBatch batch =
      seen_from(set_up_elsewhere(), test::measured(robot, 30, 84), "moved");
  const std::string text = serialize(test::demand(train(cell, batch, from(model, {"base"}))));
  const auto refusal = [&](const std::function<void(nlohmann::json & origin)>& change) {
    auto file = nlohmann::json::parse(text);
    change(file["content"]["bias_origin"]);
    file["hash"] = sha256_hex(file["content"].dump());
    const Result<CompensatedModel> read = deserialize(file.dump(), "file");
    return refusal_of(read);
  };
  EXPECT_EQ(refusal([](nlohmann::json&) {}), Refusal::none());
  EXPECT_EQ(refusal([](nlohmann::json& origin) {
              origin["error_sources"] = nlohmann::json::array();
              origin["values"] = {{"rows", 0}, {"columns", 1}, {"values", nlohmann::json::array()}};
            }),
            Refusal("file", {}, "bias").text("base"));
  EXPECT_EQ(refusal([](nlohmann::json& origin) { origin["X_WB"]["values"][0] = 5; }),
            Refusal("file", {}, "bias_origin: base").beyond(24, 1e-6));
  EXPECT_EQ(
      refusal([](nlohmann::json& origin) { origin["tools"]["spindle"]["values"][3] = 1e300; }),
      Refusal("file", {}, "bias_origin: tool spindle"));
  EXPECT_EQ(refusal([](nlohmann::json& origin) { origin["covariance"]["values"][0] = -1e-3; }),
            Refusal("file", {}, "covariance").beyond(-1e-3, 0));
  EXPECT_EQ(refusal([](nlohmann::json& origin) {
              origin["covariance"] = {{"rows", 1}, {"columns", 1}, {"values", {1.0}}};
            }),
            Refusal("file", {}, "covariance").beyond(1, 30));
}

TEST(Refit, ACauseThatTheModelDidNotHaveIsAdded) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 120, 85), "M3", "none");
  const ErrorSourcePtr map = test::demand(make_error_source("joint_map:2@1", *cell));
  const Eigen::Index first = add_source(robot.truth, map);
  robot.truth.values(first) = 80e-6;
  const CompensatedModel refit =
      test::demand(train(cell, test::measured(robot, 60, 86), from(model, {"joint_map:2@1"})));
  EXPECT_NE(refit.provenance().level.find("joint_map:2@1"), std::string::npos);
  const std::vector<Eigen::Index> kept = kept_parameters(refit.parts().physics, "joint_map:2@1");
  EXPECT_EQ(refit.parts().physics.values(kept), model.parts().physics.values);
  EXPECT_EQ(Eigen::MatrixXd(refit.parts().covariance(kept, kept)), model.parts().covariance);
  const MeasurementBatch fresh = test::measured(robot, 200, 87);
  EXPECT_GT(to_mm(model.evaluate(fresh).compensated.rms), 0.05);
  EXPECT_LT(to_mm(refit.evaluate(fresh).compensated.rms), 0.026);
}

TEST(Refit, RefusesAFrameThatIsNotTheModelsAndIsNotNamed) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 60, 88), "M1", "none");
  auto other = std::make_shared<Cell>(*cell);
  other->tools.at("spindle")->translation().z() += 0.05;
  const auto refused = train(other, test::measured(robot, 20, 89), from(model, {"base"}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refusal_of(refused), Refusal("", {}, "tool: xyz_mm").value(50));
}

TEST(Refit, AToolThatIsTurnedInTheCellFileAndNotNamedIsToldAsAFrameNotAsOrientations) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 60, 95), "M1", "none");
  auto turned = std::make_shared<Cell>(*cell);
  turned->tools.at("spindle")->linear() = Matrix3::Identity();
  const auto refused = train(turned, test::measured(robot, 20, 96), from(model, {"base"}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refusal_of(refused), Refusal("", {}, "tool: q_wxyz").value(45));
}

class MeasuredRobot : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(std::string(TRAMMEL_SOURCE_DIR) +
                                 "/../shared/data/ur10_series_c.csv"))
      GTEST_SKIP() << "the measured UR10 is not at hand (../shared/data)";
  }
  static std::shared_ptr<const Cell> cell() {
    return std::make_shared<const Cell>(
        test::demand(read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/ur10.yaml")));
  }
  /// Every `stride`-th pose, at most `count`.
  static MeasurementBatch series(const std::string& name, std::size_t count, std::size_t stride) {
    MeasurementBatch batch = test::demand(read_batch_csv(
        std::string(TRAMMEL_SOURCE_DIR) + "/../shared/data/ur10_series_" + name + ".csv"));
    std::vector<Measurement> some;
    for (std::size_t i = 0; i < batch.measurements.size() && some.size() < count; i += stride)
      some.push_back(batch.measurements[i]);
    batch.measurements = std::move(some);
    batch.source_text.clear();
    return batch;
  }
};

TEST_F(MeasuredRobot, Ur10KeepsItsToolWhereOnlyTheBaseIsNamed) {
  const CompensatedModel c = trained(cell(), series("c", 300, 9), "M3", "matern52");
  const MeasurementBatch d = series("d", 60, 7);
  const CompensatedModel base = test::demand(train(cell(), d, from(c, {"base"})));
  expect_kept(base, c, "base");
  EXPECT_GT(to_mm(base.parts().physics.tools.at("tmac").translation().z()), 50);
  const CompensatedModel both = test::demand(train(cell(), d, from(c, {"base", "tool"})));
  const Evaluation fresh =
      both.evaluate(test::demand(check_against_cell(series("d", 200, 5), *cell())).rows());
  RecordProperty("base_and_tool_mm", fmt::format("{:.4f}", to_mm(fresh.compensated.rms)));
  RecordProperty("calibrated_mm", fmt::format("{:.4f}", to_mm(fresh.calibrated.rms)));
  EXPECT_LT(to_mm(fresh.calibrated.rms), 0.6);
  EXPECT_GT(fresh.coverage_95, 0.9);
}

}  // namespace
}  // namespace trammel
