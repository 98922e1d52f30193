#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "server/measurement/measurement.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

constexpr const char* kReferences =
    "name,x_mm,y_mm,z_mm\nR1,0,0,0\nR2,3000,0,0\nR3,0,2000,0\nR4,0,0,1500\nR5,900,800,700\n";
/// The same reflectors from a tracker that stands 1 m further along x.
constexpr const char* kMoved = "R1,-1000,0,0\nR2,2000,0,0\nR3,-1000,2000,0\nR4,-1000,0,1500\nR5,-100,800,700\n";
constexpr const char* kBatch = "q1_deg,x_mm,y_mm,z_mm\n10,1,2,3\n";

class MeasurementCommands : public testing::Test {
 protected:
  static int trammel(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "trammel");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  nlohmann::json json(const std::string& name) const {
    return nlohmann::json::parse(test::read_file(folder_.file(name)), nullptr, false);
  }
  test::TemporaryFolder folder_;
};

TEST_F(MeasurementCommands, ConvertJoinsPointsWithThePlan) {
  const std::string points = folder_.write("sa.txt", "// Units: inches\nMain b 1 2 3\nMain a 4 5 6\n");
  const std::string plan = folder_.write("plan.csv", "pose_id,q1_deg\na,10\nb,20\nc,30\n");
  const std::string batch = folder_.file("batch.csv");
  ASSERT_EQ(trammel({"convert", "--points", points, "--joints", plan, "--tool", "probe", "-o", batch, "--json",
                     folder_.file("out.json")}),
            0);
  const MeasurementBatch read = test::demand(read_batch_csv(batch));
  ASSERT_EQ(read.measurements.size(), 2u);
  EXPECT_EQ(read.measurements[0].pose_id, "b");
  EXPECT_EQ(read.measurements[0].context.tool, "probe");
  EXPECT_NEAR(read.measurements[0].p_W.x(), 0.0254, 1e-12);
  EXPECT_EQ(json("out.json")["not_measured"], 1);
}

TEST_F(MeasurementCommands, ConvertReadsRoboDk) {
  const std::string robodk = folder_.write("rdk.csv", "J1;X;Y;Z\n10;1,5;2;3\n");
  ASSERT_EQ(trammel({"convert", "--robodk", robodk, "-o", folder_.file("batch.csv")}), 0);
  const MeasurementBatch read = test::demand(read_batch_csv(folder_.file("batch.csv")));
  EXPECT_NEAR(read.measurements.at(0).p_W.x(), 1.5e-3, 1e-15);
}

TEST_F(MeasurementCommands, ConvertTellsWrongUsageFromRefusedData) {
  const std::string points = folder_.write("sa.txt", "a 1 2 3\n");
  const std::string plan = folder_.write("plan.csv", "pose_id,q1_deg\nb,20\n");
  const std::string batch = folder_.file("batch.csv");
  EXPECT_EQ(trammel({"convert", "-o", batch}), 2);
  EXPECT_EQ(trammel({"convert", "--points", points, "-o", batch}), 2);
  EXPECT_EQ(trammel({"convert", "--points", points, "--joints", plan, "--unit", "feet", "-o", batch}), 2);
  EXPECT_EQ(trammel({"convert", "--points", points, "--joints", plan, "-o", batch}), 3);
  EXPECT_FALSE(std::filesystem::exists(batch));
}

TEST_F(MeasurementCommands, ReferencesMoveABatchIntoTheOldFrame) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured = folder_.write("now.csv", std::string("name,x_mm,y_mm,z_mm\n") + kMoved);
  const std::string batch = folder_.write("batch.csv", kBatch);
  ASSERT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch, "-o",
                     folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            0);
  EXPECT_NEAR(test::demand(read_batch_csv(folder_.file("there.csv"))).measurements.at(0).p_W.x(), 1.001, 1e-9);
  const nlohmann::json out = json("out.json");
  EXPECT_EQ(out["verdict"], "localise_and_repeat");
  EXPECT_NEAR(out["rms_mm"], 1000, 1e-6);
  EXPECT_NEAR(out["rms_remaining_mm"], 0, 1e-6);
  EXPECT_NEAR(out["transform"]["xyz_mm"][0], 1000, 1e-6);
  EXPECT_EQ(out["reflectors"].size(), 5u);
}

TEST_F(MeasurementCommands, ReferencesLeaveABatchAsItIsWhenAllIsFine) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured =
      folder_.write("now.csv", "name,x_mm,y_mm,z_mm\nR1,0.01,0,0\nR2,3000.01,0,0\nR3,0.01,2000,0\nR4,0.01,0,1500\n");
  const std::string batch = folder_.write("batch.csv", kBatch);
  ASSERT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch, "-o",
                     folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            0);
  EXPECT_EQ(json("out.json")["verdict"], "fine");
  EXPECT_EQ(json("out.json")["not_measured"], nlohmann::json({"R5"}));
  EXPECT_NEAR(test::demand(read_batch_csv(folder_.file("there.csv"))).measurements.at(0).p_W.x(), 1e-3, 1e-15);
}

TEST_F(MeasurementCommands, ReferencesThatMovedAgainstEachOtherLocaliseNothing) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured = folder_.write(
      "now.csv", "name,x_mm,y_mm,z_mm\nR1,0,0,0\nR2,3000,0,0\nR3,0,2000,0\nR4,0,0,1500\nR5,905,800,700\n");
  const std::string batch = folder_.write("batch.csv", kBatch);
  EXPECT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch, "-o",
                     folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            3);
  EXPECT_FALSE(std::filesystem::exists(folder_.file("there.csv")));
  EXPECT_EQ(json("out.json")["rigid"], false);
  EXPECT_EQ(json("out.json")["worst"], "R5");
  EXPECT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch}), 2);
}

}  // namespace
}  // namespace trammel::cli
