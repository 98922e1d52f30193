// An arm whose lengths are written down here, not read by the project's kinematics: its budget must
// name what was put wrong.
#include "server/compensate/budget/error_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <tuple>

#include "server/base/text_file.h"
#include "server/compensate/budget/after_repair.h"
#include "server/compensate/budget/between.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/budget/remedies.h"
#include "server/compensate/model_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

constexpr double kRight = 1.5707963267948966;
constexpr double kDegree = kRight / 90;

/// theta, d, a, alpha of each link, m and rad; how the controller counts.
struct Link {
  double theta = 0, d = 0, a = 0, alpha = 0, sign = 1;
};
using Arm = std::vector<Link>;

Arm irb120() {
  return {{0, 0.29, 0, -kRight},           {-kRight, 0, 0.27, 0}, {0, 0, 0.07, -kRight},
          {2 * kRight, 0.302, 0, -kRight}, {0, 0, 0, kRight},     {0, 0.072, 0, 0}};
}

/// What is put wrong.
struct World {
  Arm arm = irb120();
  Eigen::VectorXd zeros =
      Eigen::VectorXd::Zero(6);    ///< rad, as the controller counts: the joint stands farther
  Vector3 base = Vector3::Zero();  ///< m, where the robot really stands
  Vector3 tool = Vector3(0.04, -0.025, 0.14);  ///< m
  double ripple = 0;                           ///< rad, of the gear of joint 3, 20 waves a turn
};

Eigen::Isometry3d flange(const World& world, const Eigen::VectorXd& q) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translate(world.base);
  for (std::size_t i = 0; i < world.arm.size(); ++i) {
    const Link& link = world.arm[i];
    const auto k = static_cast<Eigen::Index>(i);
    const double ripple = i == 2 ? world.ripple * std::sin(20 * q(k)) : 0;
    X.rotate(Eigen::AngleAxisd(link.theta + link.sign * (q(k) + world.zeros(k)) + ripple,
                               Vector3::UnitZ()));
    X.translate(Vector3(link.a, 0, link.d));
    X.rotate(Eigen::AngleAxisd(link.alpha, Vector3::UnitX()));
  }
  return X;
}

Vector3 tip(const World& world, const Eigen::VectorXd& q) { return flange(world, q) * world.tool; }

std::vector<Eigen::VectorXd> drawn_poses(int count) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-1.1, 1.1);
  std::vector<Eigen::VectorXd> poses;
  for (int k = 0; k < count; ++k)
    poses.push_back(Eigen::VectorXd::NullaryExpr(6, [&] { return angle(random); }));
  return poses;
}

/// The same poses with a wrist that holds the tool within a degree of one way.
std::vector<Eigen::VectorXd> poses_held_one_way(int count) {
  const World drawing;
  const Eigen::VectorXd middle = (Eigen::VectorXd(6) << 0, 0, 0, 0.3, 1.2, -0.3).finished();
  const Matrix3 wanted = flange(drawing, middle).linear();
  std::vector<Eigen::VectorXd> poses = drawn_poses(count);
  for (Eigen::VectorXd& q : poses) {
    const Eigen::VectorXd drawn = q;
    q = middle;
    for (int step = 1; step <= 40; ++step) {  // from the middle, where the wrist fits, step by step
      q.head<3>() = 0.4 * std::min(step / 20.0, 1.0) * drawn.head<3>();
      const Matrix3 R = flange(drawing, q).linear();
      const Eigen::AngleAxisd missing(Matrix3(wanted * R.transpose()));
      Matrix3 axes;
      for (int k = 0; k < 3; ++k) {
        Eigen::VectorXd moved = q;
        moved(3 + k) += 1e-4;
        const Eigen::AngleAxisd turn(Matrix3(flange(drawing, moved).linear() * R.transpose()));
        axes.col(k) = turn.angle() / 1e-4 * turn.axis();
      }
      q.tail<3>() += axes.fullPivLu().solve(Vector3(missing.angle() * missing.axis()));
    }
    q.tail<3>() += 0.01 * drawn.tail<3>();
  }
  return poses;
}

MeasurementBatch measured(const World& world, const std::vector<Eigen::VectorXd>& poses) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0, 0.013e-3);
  MeasurementBatch batch;
  batch.id = "own-arm";
  for (const Eigen::VectorXd& q : poses) {
    Measurement m;
    m.pose_id = fmt::format("p{}", batch.measurements.size() + 1);
    m.row = static_cast<int>(batch.measurements.size()) + 2;
    m.context.q = q;
    m.context.tool = "tip";
    m.p_W = tip(world, q) + Vector3(noise(random), noise(random), noise(random));
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

std::shared_ptr<const Cell> own_cell(const std::string& robot_yaml, const std::string& sources) {
  const std::string text = fmt::format(
      "version: 1\ncell: own\nrobot: robot.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, "
      "0]}}\n"
      "tools: {{tip: {{xyz_mm: [40, -25, 140], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.013, sigma_deg: 0.003}}\nmodel: {{error_sources: [{}], bias: "
      "none}}\n",
      sources);
  return std::make_shared<const Cell>(test::demand(parse_cell(text, robot_yaml, "cell.yaml")));
}

std::string shipped_robot() {
  return test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/abb_irb120-3-06.yaml"));
}

CompensatedModel trained_on(const MeasurementBatch& batch, const std::string& sources,
                            const std::string& robot_yaml = shipped_robot()) {
  const auto cell = own_cell(robot_yaml, sources);
  TrainOptions options;
  options.bias = "none";
  return test::demand(
      train(cell, test::demand(check_against_cell(batch, *cell, drawn(0, 1))), options));
}

CompensatedModel trained(const World& world, const std::string& sources, int poses = 120,
                         const std::string& robot_yaml = shipped_robot()) {
  return trained_on(measured(world, drawn_poses(poses)), sources, robot_yaml);
}

/// With the tool and the payload that the model knows.
std::vector<PoseContext> at_poses_of(const CompensatedModel& model, int count) {
  std::vector<PoseContext> poses;
  for (const Eigen::VectorXd& q : drawn_poses(count)) {
    PoseContext pose;
    pose.q = q;
    std::tie(pose.tool, pose.payload) = *model.parts().trained_with.begin();
    poses.push_back(pose);
  }
  return poses;
}

const ErrorBudget& budget_of(const CompensatedModel& model) {
  EXPECT_TRUE(model.parts().budget);
  return *model.parts().budget;
}

/// mm rms: how far the tip goes when joint `j` (0-based) gets its zero back.
double alone_by_hand(const World& world, Eigen::Index j,
                     const std::vector<Eigen::VectorXd>& poses) {
  World right = world;
  right.zeros(j) = 0;
  double sum = 0;
  for (const Eigen::VectorXd& q : poses) sum += (tip(world, q) - tip(right, q)).squaredNorm();
  return 1e3 * std::sqrt(sum / static_cast<double>(poses.size()));
}

double sum_of_shares(const BudgetView& view) {
  return std::accumulate(view.lines.begin(), view.lines.end(), 0.0,
                         [](double sum, const BudgetLine& line) { return sum + line.share; });
}

TEST(ErrorBudget, LeadsWithTheLostZeroItsAngleItsMillimetresAndWhatToDo) {
  World world;
  world.zeros(3) = 3 * kDegree;
  world.zeros(4) = -2 * kDegree;
  const CompensatedModel model = trained(world, "base, geometry");
  const ErrorBudget& budget = budget_of(model);
  ASSERT_GT(budget.as_it_stands.lines.size(), 2u);
  for (const int joint : {4, 5}) {
    const BudgetLine* line = budget.line(fmt::format("zero:{}", joint));
    ASSERT_NE(line, nullptr) << joint;
    const double truth = world.zeros(joint - 1) / kDegree;
    ASSERT_TRUE(line->value);
    EXPECT_EQ(line->value->unit, "deg");
    EXPECT_NEAR(line->value->value, truth, std::max(2 * line->value->u95, 0.005)) << joint;
    EXPECT_LT(line->value->u95, 0.05) << joint;
    const double by_hand = alone_by_hand(world, joint - 1, drawn_poses(120));
    EXPECT_NEAR(1e3 * line->alone_rms, by_hand, 0.02 * by_hand) << joint;
    EXPECT_EQ(line->action, fmt::format("re-master joint {}", joint));
    EXPECT_GT(*line->times_usual, 10) << joint;
  }
  EXPECT_EQ(budget.as_it_stands.lines.front().line.substr(0, 5), "zero:");
  EXPECT_NE(in_words(budget).at(1).find("re-master joint"), std::string::npos)
      << in_words(budget).at(1);
  const std::string lead = lead_of(budget);
  for (const char* part :
       {"because of the zero of joint ", "re-master joint 4", "re-master joint 5"})
    EXPECT_NE(lead.find(part), std::string::npos) << lead;
}

TEST(ErrorBudget, OfAToolThatIsHeldOneWayIsNotAPlaceAndAToolThatPullAgainstEachOther) {
  World world;
  world.ripple = 3e-3;  // is left, and larger than what tells the place from the tool
  const CompensatedModel model =
      trained_on(measured(world, poses_held_one_way(400)), "base, geometry, tool");
  const ErrorBudget& budget = budget_of(model);
  for (const char* name : {"base", "tool"}) {
    const BudgetLine* line = budget.line(name);
    ASSERT_NE(line, nullptr) << name;
    EXPECT_LT(1e3 * line->alone_rms, 3) << name << ", of " << 1e3 * budget.as_it_stands.error_rms;
    EXPECT_EQ(line->action, "") << name;
  }
  const auto& with = budget.line("base")->with;
  EXPECT_NE(std::find(with.begin(), with.end(), "tool"), with.end());
  EXPECT_NEAR(sum_of_shares(budget.as_it_stands), 1, 1e-9);
}

TEST(ErrorBudget, AddsUpToTheWholeInBothViews) {
  World world;
  world.zeros << 2e-3, 30e-3, -1e-3, 52e-3, -35e-3, 3e-3;
  world.base = Vector3(0.004, -0.003, 0.002);
  world.tool += Vector3(0.001, 0, -0.002);
  const CompensatedModel model = trained(world, "base, geometry, tool");
  const ErrorBudget& budget = budget_of(model);
  EXPECT_NEAR(sum_of_shares(budget.as_it_stands), 1, 1e-9);
  EXPECT_NEAR(sum_of_shares(budget.beyond_frames), 1, 1e-9);
  EXPECT_LT(budget.beyond_frames.error_rms, budget.as_it_stands.error_rms);
  EXPECT_NEAR(budget.as_it_stands.error_rms, model.parts().training.nominal.rms, 1e-12);
}

TEST(ErrorBudget, CountsWhatThePosesCannotTellApartOnceAndNamesBoth) {
  World world;
  world.tool += Vector3(0, 0, 0.005);  // along the sixth axis, as d6 is
  const CompensatedModel model = trained(world, "base, geometry, tool");
  const ErrorBudget& budget = budget_of(model);
  const BudgetLine* tool = budget.line("tool");
  const BudgetLine* base = budget.line("base");
  ASSERT_NE(tool, nullptr);
  ASSERT_NE(base, nullptr);
  const auto names = [](const BudgetLine& line, const char* other) {
    return std::find(line.with.begin(), line.with.end(), other) != line.with.end();
  };
  EXPECT_TRUE(names(*tool, "length:6"));
  EXPECT_TRUE(names(*base, "zero:1"));
  EXPECT_TRUE(names(*base, "length:1"));
  EXPECT_NEAR(tool->value->value, 5, 0.1);
  EXPECT_EQ(budget.line("length:6"), nullptr);
  const std::string told = sentence(*base);
  EXPECT_NE(told.find("cannot tell it from the lengths of link 1, the zero of joint 1"),
            std::string::npos)
      << told;
  EXPECT_NE(told.find(", turned by "), std::string::npos) << told;
  for (const BudgetLine& line : budget.as_it_stands.lines) {
    const bool is_tool = line.line == "tool";
    EXPECT_TRUE(is_tool || line.alone_rms < 0.3e-3) << line.line;
  }
}

TEST(ErrorBudget, TwoNumbersThatThePosesTellTogetherOnlyNameEachOther) {
  World world;
  world.tool += Vector3(0, 0, 0.005);
  const CompensatedModel model = trained(world, "base, geometry, tool");
  ModelParts parts = model.parts();
  std::vector<Eigen::Index> both;
  for (Eigen::Index k = 0; k < std::ssize(parts.parameters); ++k) {
    const std::string& name = parts.parameters[static_cast<std::size_t>(k)].parameter.name;
    if (name == "tz" || name == "d6") both.push_back(k);
  }
  ASSERT_EQ(both.size(), 2u);
  const auto with_correlation = [&](double correlation) {
    parts.covariance(both, Eigen::all).setZero();
    parts.covariance(Eigen::all, both).setZero();
    const double variance = 0.3e-3 * 0.3e-3;  // each is told, to 0.3 mm
    parts.covariance(both, both) << variance, correlation * variance, correlation * variance,
        variance;
    const auto changed = test::demand(CompensatedModel::make(parts));
    return error_budget(changed, measured(world, drawn_poses(60)));
  };
  const auto names = [](const BudgetLine* line, const char* other) {
    return line != nullptr &&
           std::find(line->with.begin(), line->with.end(), other) != line->with.end();
  };
  const ErrorBudget together = with_correlation(-0.9999), apart = with_correlation(-0.9);
  EXPECT_TRUE(names(together.line("length:6"), "tool"));
  ASSERT_NE(apart.line("length:6"), nullptr);
  EXPECT_FALSE(names(apart.line("length:6"), "tool"));
}

TEST(ErrorBudget, OfAGearboxFarSofterThanOnesOfItsSizeAsksForThePayloadThenForTheGearbox) {
  const auto cell = test::cell_7();
  for (const double times : {1.0, 6.0}) {
    VirtualRobot robot = test::chapter_5_robot(cell);
    const std::vector<Parameter> parameters = robot.truth.parameters();
    for (std::size_t k = 0; k < parameters.size(); ++k)
      if (parameters[k].name == "C3") robot.truth.values(static_cast<Eigen::Index>(k)) *= times;
    TrainOptions options;
    options.bias = "none";
    const CompensatedModel model = test::demand(train(
        cell, test::demand(check_against_cell(test::measured(robot, 120, 5), *cell, drawn(0, 1))),
        options));
    const BudgetLine* gear = budget_of(model).line("compliance:3");
    ASSERT_NE(gear, nullptr);
    ASSERT_TRUE(gear->times_usual);
    EXPECT_NEAR(*gear->times_usual, times * 0.23 / 0.15, 0.2 * times)
        << "4e-9 rad/Nmm are 0.23 deg/kNm; joints of large arms show 0.15";
    EXPECT_EQ(gear->action.empty(), times < 2) << gear->action;
  }
}

TEST(ErrorBudget, TellsAHealthyArmThatNothingStandsOut) {
  World world;
  world.zeros << 2e-4, -3e-4, 2e-4, 4e-4, -5e-4, 3e-4;
  world.base = Vector3(0.02, -0.01, 0.005);
  world.arm[1].a += 0.2e-3;
  world.arm[2].alpha += 3e-4;
  const CompensatedModel model = trained(world, "base, geometry");
  for (const BudgetLine& line : budget_of(model).as_it_stands.lines)
    EXPECT_EQ(line.action, "") << line.line;
  EXPECT_NE(in_words(budget_of(model)).front().find("no zero, length, angle or tool is far from"),
            std::string::npos)
      << in_words(budget_of(model)).front();
  EXPECT_EQ(lead_of(budget_of(model)), "");
}

TEST(ErrorBudget, OfABaseThatStandsElsewhereIsNothingBeyondFrames) {
  World world;
  world.base = Vector3(0.05, -0.03, 0.01);
  const CompensatedModel model = trained(world, "base, geometry");
  const ErrorBudget& budget = budget_of(model);
  EXPECT_NEAR(1e3 * budget.as_it_stands.error_rms, 59.2, 0.1);
  EXPECT_LT(1e3 * budget.beyond_frames.error_rms, 0.05);
  EXPECT_EQ(budget.as_it_stands.lines.front().line, "base");
  EXPECT_NEAR(budget.as_it_stands.lines.front().share, 1, 0.01);
}

TEST(ErrorBudget, TellsAZeroAsTheControllerCounts) {
  World world;
  world.arm[3].sign = -1;
  world.zeros(3) = 3 * kDegree;
  std::string robot = shipped_robot();
  // The fourth joint of the shipped file, counted the other way.
  std::size_t row = robot.find("joints:");
  for (int k = 0; k < 4; ++k) row = robot.find("- {", row + 1);
  ASSERT_NE(row, std::string::npos) << robot;
  robot.insert(row + 3, "sign: -1, ");
  const CompensatedModel model = trained(world, "base, geometry", 120, robot);
  const BudgetLine* line = budget_of(model).line("zero:4");
  ASSERT_NE(line, nullptr);
  EXPECT_NEAR(line->value->value, 3, 0.05);
}

TEST(ErrorBudget, NamesWhatTooFewPosesCannotTellInOneLine) {
  World world;
  const CompensatedModel model = trained(world, "base, geometry", 6);
  const BudgetLine* untold = budget_of(model).line("untold");
  ASSERT_NE(untold, nullptr);
  EXPECT_GT(untold->with.size(), 3u);
  EXPECT_NE(untold->name.find("poses tell it"), std::string::npos) << untold->name;
  for (const BudgetLine& line : budget_of(model).as_it_stands.lines)
    EXPECT_EQ(line.action, "") << line.line;
}

TEST(ErrorBudget, OfAModelWithoutAnyParameterIsWhatIsLeft) {
  World world;
  world.base = Vector3(0.002, 0, 0);
  const CompensatedModel model = trained(world, "");
  const ErrorBudget& budget = budget_of(model);
  EXPECT_NEAR(sum_of_shares(budget.as_it_stands), 1, 1e-9);
  const BudgetLine* rest = budget.line("rest");
  ASSERT_NE(rest, nullptr);
  EXPECT_NEAR(1e3 * rest->alone_rms, 2, 0.05);
}

TEST(ErrorBudget, SaysWhatEachStepLeaves) {
  World world;
  world.zeros(3) = 3 * kDegree;
  world.base = Vector3(0.01, 0, 0);
  world.arm[1].a += 0.002;
  const CompensatedModel model = trained(world, "base, geometry");
  const std::vector<PutRight>& steps = budget_of(model).put_right;
  ASSERT_EQ(steps.size(), 6u);
  EXPECT_EQ(steps.front().step, "nothing");
  EXPECT_LT(steps[1].left_rms, steps[0].left_rms);        // frames
  EXPECT_LT(steps[2].left_rms, 0.2 * steps[1].left_rms);  // the zero of joint 4
  EXPECT_LT(steps[3].left_rms, 0.05e-3);                  // the length of link 2
  EXPECT_LT(steps[5].left_rms, 0.03e-3);
  const std::vector<std::string> words = remedies_in_words(budget_of(model), model.cell().robot);
  EXPECT_TRUE(std::any_of(words.begin(), words.end(), [](const std::string& line) {
    return line.find("joint 4 (axis 4): +3.00") != std::string::npos;
  })) << fmt::format("{}", fmt::join(words, "\n"));
}

TEST(ErrorBudget, AtTargetsIsThatOfThePredictedError) {
  World world;
  world.zeros(3) = 3 * kDegree;
  const CompensatedModel model = trained(world, "base, geometry");
  std::vector<PoseContext> targets;
  for (const Eigen::VectorXd& q : drawn_poses(5)) {
    PoseContext target;
    target.q = q;
    target.tool = "tip";
    targets.push_back(target);
  }
  const ErrorBudget budget = error_budget(model, targets);
  EXPECT_EQ(budget.poses, 5);
  EXPECT_EQ(budget.as_it_stands.lines.front().line, "zero:4");
  EXPECT_LT(budget.put_right.back().left_rms, 1e-9);
  EXPECT_NEAR(sum_of_shares(budget.as_it_stands), 1, 1e-9);
}

TEST(ErrorBudget, IsKeptInTheFileOfItsModel) {
  World world;
  world.zeros(4) = 0.01;
  const CompensatedModel model = trained(world, "base, geometry");
  const CompensatedModel read = test::demand(deserialize(serialize(model), "model.json"));
  EXPECT_EQ(in_words(budget_of(read), 40), in_words(budget_of(model), 40));
}

TEST(ErrorBudget, BetweenTwoModelsNamesWhatChangedFromOneToTheOther) {
  World before;
  before.zeros(2) = 0.5 * kDegree;
  World now = before;
  now.zeros(3) = 0.4 * kDegree;
  now.base = Vector3(0.02, 0.01, 0);  // the tracker stands elsewhere: that is no change of the arm
  const CompensatedModel one = trained(before, "base, geometry"),
                         other = trained(now, "base, geometry");
  const ModelDifference difference = difference_between(one, other, at_poses_of(one, 60));
  const BudgetLine& first = difference.budget.beyond_frames.lines.front();
  EXPECT_EQ(first.line, "zero:4");
  ASSERT_TRUE(first.value);
  EXPECT_NEAR(first.value->value, 0.4, 0.02);
  EXPECT_GT(first.share, 0.9);
  const BudgetLine* unchanged = difference.budget.line("zero:3");
  ASSERT_NE(unchanged, nullptr);
  EXPECT_LT(1e3 * unchanged->alone_rms, 0.2);
  const auto q4 = std::find_if(difference.parameters.begin(), difference.parameters.end(),
                               [](const ParameterDifference& each) { return each.name == "q4"; });
  ASSERT_NE(q4, difference.parameters.end());
  EXPECT_NEAR(q4->difference(), 0.4 * kDegree, 0.02 * kDegree);
  EXPECT_GT(std::abs(q4->difference()), q4->u95);
}

TEST(ErrorBudget, BetweenTwoModelsIsARippleThatGrewAtItsOwnOrder) {
  World before, now;
  before.ripple = 2e-4;
  now.ripple = 8e-4;
  const std::string sources = "base, geometry, 'gear_transmission:3@20'";
  const CompensatedModel one = trained(before, sources), other = trained(now, sources);
  const ModelDifference difference = difference_between(one, other, at_poses_of(one, 60));
  const BudgetLine& first = difference.budget.beyond_frames.lines.front();
  EXPECT_EQ(first.line, "gear_transmission:3") << "the order is no part of its name";
  EXPECT_GT(first.share, 0.9);
  const ModelDifference gone =
      difference_between(other, trained(before, "base, geometry"), at_poses_of(other, 60));
  EXPECT_EQ(gone.budget.beyond_frames.lines.front().line, "gear_transmission:3");
}

/// The outcome of zero 4 in a model of `after`, held against one in which it was off by 3 degrees.
LineOutcome::Helped outcome_of_zero_4(const World& after) {
  World before;
  before.zeros(3) = 3 * kDegree;
  const CompensatedModel one = trained(before, "base, geometry"),
                         other = trained(after, "base, geometry");
  const AfterRepair repair = after_repair(one, other, at_poses_of(one, 60));
  const auto line = std::find_if(repair.lines.begin(), repair.lines.end(),
                                 [](const LineOutcome& each) { return each.line == "zero:4"; });
  if (line == repair.lines.end()) {
    ADD_FAILURE() << "zero 4 is no line";
    return LineOutcome::Helped::kCannotTell;
  }
  EXPECT_NEAR(line->before.value, 3, 0.05);
  EXPECT_NEAR(line->now.value, after.zeros(3) / kDegree, 0.05);
  EXPECT_GT(1e3 * line->alone_before, 1);
  return line->helped;
}

TEST(ErrorBudget, AfterARepairSaysWhetherItHelped) {
  using Helped = LineOutcome::Helped;
  World after;
  EXPECT_EQ(outcome_of_zero_4(after), Helped::kPutRight);
  after.zeros(3) = 3 * kDegree;
  EXPECT_EQ(outcome_of_zero_4(after), Helped::kNotMoved);
  after.zeros(3) = 1 * kDegree;
  EXPECT_EQ(outcome_of_zero_4(after), Helped::kPartly);
  after.zeros(3) = -3 * kDegree;
  EXPECT_EQ(outcome_of_zero_4(after), Helped::kTooFar) << "twice the remedy";
  after.zeros(3) = 6 * kDegree;
  EXPECT_EQ(outcome_of_zero_4(after), Helped::kWrongWay) << "the remedy with the wrong sign";
}

TEST(ErrorBudget, OfSeveralWrongLengthsAsksFirstWhetherTheFileIsOfThisRobot) {
  ErrorBudget budget;
  for (const int link : {2, 4}) {
    BudgetLine line;
    line.line = fmt::format("length:{}", link);
    line.kind = LineKind::kLength;
    line.name = fmt::format("the length of link {}", link);
    line.value = BudgetNumber{fmt::format("a{}", link), 150, 0.1, "mm"};
    line.action = "compare the robot file with the maker's drawing";
    budget.as_it_stands.lines.push_back(line);
  }
  EXPECT_EQ(in_words(budget).front().find("is this the file of this robot?"), 0u)
      << in_words(budget).front();
  budget.as_it_stands.lines.pop_back();
  EXPECT_EQ(in_words(budget).front().find("is this the file"), std::string::npos)
      << "one link may be bent";
}

TEST(ErrorBudget, NamesAnAxisAsItsMakerDoes) {
  const auto robot = [](const char* file) {
    return test::demand(read_robot(std::string(TRAMMEL_SOURCE_DIR "/models/") + file));
  };
  EXPECT_EQ(makers_words(robot("kuka_kr210-r2700-extra.yaml")).axis(3), "A4");
  EXPECT_EQ(makers_words(robot("yaskawa_gp25.yaml")).axis(3), "R");
  EXPECT_EQ(makers_words(robot("kuka_lbr-iiwa-7-r800.yaml")).axis(6), "joint 7")
      << "an arm of seven joints counts otherwise";
}

TEST(ErrorBudget, TellsWhatOneOfSeveralZerosDoesByItself) {
  World world;
  const CompensatedModel model = trained(world, "base, geometry");
  const MeasurementBatch batch = measured(world, drawn_poses(60));
  World off = world;
  off.zeros(3) = 1 * kDegree;
  const double as_it_stands = alone_by_hand(off, 3, drawn_poses(60));
  const double beyond = 1e3 * alone_of_zero(model, 3, 1 * kDegree, batch);
  EXPECT_LT(beyond, as_it_stands);
  EXPECT_GT(beyond, 0.5 * as_it_stands);
}

TEST(ErrorBudget, BetweenAModelAndItselfIsNothing) {
  World world;
  world.zeros(2) = 0.5 * kDegree;
  const CompensatedModel model = trained(world, "base, geometry");
  const ModelDifference difference = difference_between(model, model, at_poses_of(model, 20));
  EXPECT_EQ(difference.budget.as_it_stands.error_rms, 0);
  for (const BudgetLine& line : difference.budget.as_it_stands.lines)
    EXPECT_LT(line.alone_rms, 1e-12) << line.line;
}

}  // namespace
}  // namespace trammel
