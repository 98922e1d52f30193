#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

class ViewCommand : public testing::Test {
 protected:
  ViewCommand() {
    std::string cell = read_text_file(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml").value();
    cell.replace(cell.find("../models"), 9, TRAMMEL_SOURCE_DIR "/models");
    folder_.write("cell.yaml",
                  cell +
                      "obstacles:\n  floor_mm: -500\n"
                      "  boxes: {table: {lower: [900, -600, -500], upper: [2100, 600, 900]}}\n");
  }
  static int trammel(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "trammel");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  std::string text(const std::string& name) const { return read_text_file(file(name)).value(); }
  nlohmann::json found() const { return nlohmann::json::parse(text("v.json")); }

  test::TemporaryFolder folder_;
};

TEST_F(ViewCommand, DrawsAPlanAndCountsWhatTouches) {
  folder_.write("plan.csv",
                "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nlow,0,60,0,0,10,0\n"
                "away,120,-20,0,0,10,0\n");
  ASSERT_EQ(trammel({"view", file("cell.yaml"), file("plan.csv"), "-o", file("v.html"), "--json",
                     file("v.json")}),
            0);
  EXPECT_EQ(found()["poses"], 2);
  EXPECT_EQ(found()["touching_obstacle"], 1);
  EXPECT_NE(text("v.html").find("Of 2 poses 1 touch an obstacle"), std::string::npos);
}

TEST_F(ViewCommand, DrawsAProgramInTheOrderInWhichItMoves) {
  ASSERT_EQ(trammel({"view", file("cell.yaml"), TRAMMEL_SOURCE_DIR "/config/programs/drill.mod",
                     "-o", file("v.html"), "--json", file("v.json")}),
            0);
  EXPECT_EQ(found()["poses"], 8);
  EXPECT_EQ(found()["left"], nlohmann::json::array());
  const std::string page = text("v.html");
  EXPECT_LT(page.find("jHome drill.mod:12"), page.find("pHole{i} drill.mod:7"));
}

TEST_F(ViewCommand, DrawsACellAloneAndRefusesWhatIsNoPlan) {
  ASSERT_EQ(trammel({"view", file("cell.yaml"), "-o", file("v.html")}), 0);
  EXPECT_NE(text("v.html").find("The cell alone"), std::string::npos);
  folder_.write("none.csv", "a,b\n1,2\n");
  EXPECT_EQ(trammel({"view", file("cell.yaml"), file("none.csv"), "-o", file("w.html")}), 3);
  EXPECT_EQ(trammel({"view", file("cell.yaml")}), 2);
  EXPECT_FALSE(read_text_file(file("w.html")));
}

}  // namespace
}  // namespace trammel::cli
