#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/measurement/files/joint_list.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

class PlanCommand : public testing::Test {
 protected:
  int plan(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"trammel", "plan", "--cell", TRAMMEL_SOURCE_DIR "/config/cell-7.yaml"});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  std::string text(const std::string& name) const { return read_text_file(file(name)).value(); }

  test::TemporaryFolder folder_;
};

TEST_F(PlanCommand, WritesPlanProgramsAndFigures) {
  ASSERT_EQ(plan({"--count", "8", "--criterion", "separate:backlash:2,geometry", "--bidirectional", "-o", file("p.csv"),
                  "--rapid", file("p.mod"), "--krl", file("p.src"), "--json", file("p.json")}),
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
  const std::string chosen = folder_.write(
      "next.csv", "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nn1,10,20,-30,40,50,60\nn2,0,0,69.9,0,5,0\n");
  ASSERT_EQ(plan({"--from", chosen, "-o", file("p.csv"), "--rapid", file("p.mod")}), 0);
  const JointList list = read_joint_csv(file("p.csv")).value();
  ASSERT_EQ(list.poses.size(), 2u);
  EXPECT_EQ(list.poses[0].pose_id, "n1");
  EXPECT_EQ(list.poses[0].context.direction, std::vector<int>(6, 1));
  EXPECT_NE(text("p.mod").find("[10,20,-30,40,50,60]"), std::string::npos) << text("p.mod");
  EXPECT_EQ(plan({"--from", chosen, "--count", "3", "-o", file("p.csv")}), 2);
  EXPECT_EQ(plan({"-o", file("p.csv")}), 2);
}

TEST_F(PlanCommand, RefusesBeforeItWritesAnything) {
  EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--rapid", file("p.mod"), "--rapid-tool", "no tool"}), 3);
  EXPECT_FALSE(std::filesystem::exists(file("p.csv")));
  EXPECT_FALSE(std::filesystem::exists(file("p.mod")));
}

TEST_F(PlanCommand, TellsWrongCriteriaFromRightOnes) {
  for (const char* wrong : {"luck", "separate", "separate:payload", "separate:payload,payload", "separate:,payload",
                            "separate:payload,gremlins", "separate:backlash:9,payload"}) {
    EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--criterion", wrong}), 2) << wrong;
  }
  EXPECT_EQ(plan({"--count", "5", "-o", file("p.csv"), "--criterion", "observability"}), 0);
}

}  // namespace
}  // namespace trammel::cli
