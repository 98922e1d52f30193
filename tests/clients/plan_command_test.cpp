#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "clients/cam/dialect.h"
#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/joint_list.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

class PlanCommand : public testing::Test {
 protected:
  int plan(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     {"trammel", "plan", "--cell", TRAMMEL_SOURCE_DIR "/config/cell-7.yaml"});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  std::string text(const std::string& name) const { return read_text_file(file(name)).value(); }

  test::TemporaryFolder folder_;
};

TEST_F(PlanCommand, WritesPlanProgramsAndFigures) {
  ASSERT_EQ(plan({"--count", "8", "--criterion", "separate:backlash:2,geometry", "--bidirectional",
                  "-o", file("p.csv"), "--rapid", file("p.mod"), "--krl", file("p.src"), "--json",
                  file("p.json")}),
            0);
  const JointList list = read_joint_csv(file("p.csv")).value();
  ASSERT_EQ(list.poses.size(), 16u);
  EXPECT_EQ(list.poses[0].pose_id, "1-");
  EXPECT_EQ(list.poses[0].context.direction, std::vector<int>(6, -1));
  EXPECT_EQ(list.poses[1].context.direction, std::vector<int>(6, 1));
  EXPECT_TRUE(text("p.mod").starts_with("MODULE T_p\n"));
  EXPECT_NE(text("p.src").find("DEF p ( )"), std::string::npos);
  const auto json = nlohmann::json::parse(text("p.json"));
  EXPECT_EQ(json["poses"], 16);
  EXPECT_EQ(json["drawn"], json["kept"].get<int>() + json["near_joint_limit"].get<int>());
  EXPECT_GT(json["separability"]["plan"]["strength"], json["separability"]["lhs"]["strength"]);
}

TEST_F(PlanCommand, MakesAProgramOfPosesThatWereChosenElsewhere) {
  const std::string chosen = folder_.write("next.csv",
                                           "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nn1,"
                                           "10,20,-30,40,50,60\nn2,0,0,69.9,0,5,0\n");
  ASSERT_EQ(plan({"--from", chosen, "-o", file("p.csv"), "--rapid", file("p.mod")}), 0);
  const JointList list = read_joint_csv(file("p.csv")).value();
  ASSERT_EQ(list.poses.size(), 2u);
  EXPECT_EQ(list.poses[0].pose_id, "n1");
  EXPECT_EQ(list.poses[0].context.direction, std::vector<int>(6, -1));
  EXPECT_EQ(list.poses[1].context.direction, std::vector<int>(6, 1))
      << "joint 3 cannot come from above";
  EXPECT_NE(text("p.mod").find("[10,20,-30,40,50,60]"), std::string::npos) << text("p.mod");
  EXPECT_EQ(plan({"--from", chosen, "--count", "3", "-o", file("p.csv")}), 2);
  EXPECT_EQ(plan({"-o", file("p.csv")}), 2);
}

TEST_F(PlanCommand, APlanThatIsReadAgainKeepsItsSides) {
  ASSERT_EQ(plan({"--count", "7", "-o", file("p.csv")}), 0);
  ASSERT_EQ(
      plan({"--from", file("p.csv"), "-o", file("q.csv"), "--krl", file("q.src"), "--keep-order"}),
      0);
  EXPECT_EQ(text("q.csv"), text("p.csv"));
}

TEST_F(PlanCommand, EveryProgramReadsBackAsThePlanInItsOrder) {
  ASSERT_EQ(
      plan({"--count", "12", "-o", file("p.csv"), "--rapid", file("p.mod"), "--krl", file("p.src"),
            "--fanuc", file("p.ls"), "--urscript", file("p.script"), "--fanuc-tool", "3"}),
      0);
  const JointList list = read_joint_csv(file("p.csv")).value();
  ASSERT_EQ(list.poses.size(), 12u);
  for (const char* name : {"p.mod", "p.src", "p.ls", "p.script"}) {
    const cam::Program program =
        cam::read_program(*cam::dialect_of_file(name), {{name, text(name)}}, {});
    std::vector<std::vector<double>> slow;  // the second of two motions is to the pose
    for (std::size_t m = 1; m < program.moves.size(); m += 2) {
      ASSERT_EQ(program.moves[m].targets.size(), 1u) << name;
      const cam::ProgramTarget& target = program.targets[program.moves[m].targets[0]];
      slow.push_back(target.numbers);
      if (target.coordinates != cam::Coordinates::kJointRadians) continue;
      for (double& axis : slow.back()) axis = to_deg(axis);
    }
    ASSERT_EQ(slow.size(), 12u) << name;
    for (std::size_t i = 0; i < slow.size(); ++i) {
      for (Eigen::Index j = 0; j < 6; ++j)
        EXPECT_NEAR(slow[i][static_cast<std::size_t>(j)], to_deg(list.poses[i].context.q(j)), 1e-6)
            << name;
    }
  }
  EXPECT_NE(text("p.ls").find("UT : 3"), std::string::npos);
  EXPECT_EQ(
      plan({"--count", "5", "-o", file("q.csv"), "--fanuc", file("q.ls"), "--fanuc-tool", "0"}), 3);
}

TEST_F(PlanCommand, APlanWithAProgramIsInTheOrderOfLittleTravel) {
  const std::vector<std::string> options = {"--count",       "40",    "--criterion",
                                            "observability", "--krl", file("p.src")};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), options.begin(), options.end());
    return plan(more);
  };
  ASSERT_EQ(with({"-o", file("short.csv")}), 0);
  ASSERT_EQ(with({"-o", file("long.csv"), "--keep-order"}), 0);
  const JointList shorter = read_joint_csv(file("short.csv")).value(),
                  longer = read_joint_csv(file("long.csv")).value();
  const auto way = [](const JointList& list) {
    double sum = 0;
    for (std::size_t i = 1; i < list.poses.size(); ++i)
      sum += (list.poses[i].context.q - list.poses[i - 1].context.q).cwiseAbs().maxCoeff();
    return sum;
  };
  const auto ids = [](const JointList& list) {
    std::set<std::string> all;
    for (const CommandedPose& pose : list.poses) all.insert(pose.pose_id);
    return all;
  };
  EXPECT_LT(way(shorter), 0.75 * way(longer));
  EXPECT_EQ(ids(shorter), ids(longer));
  EXPECT_EQ(shorter.poses[0].pose_id, longer.poses[0].pose_id);
}

TEST_F(PlanCommand, RefusesBeforeItWritesAnything) {
  EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--rapid", file("p.mod"), "--rapid-tool",
                  "no tool"}),
            3);
  EXPECT_FALSE(std::filesystem::exists(file("p.csv")));
  EXPECT_FALSE(std::filesystem::exists(file("p.mod")));
}

TEST_F(PlanCommand, TellsWrongCriteriaFromRightOnes) {
  for (const char* wrong :
       {"luck", "separate", "separate:payload", "separate:payload,payload", "separate:,payload",
        "separate:payload,gremlins", "separate:backlash:9,payload"}) {
    EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--criterion", wrong}), 2) << wrong;
  }
  EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--criterion", "observability"}), 0);
}

}  // namespace
}  // namespace trammel::cli
