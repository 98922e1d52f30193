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
constexpr const char* kMoved =
    "R1,-1000,0,0\nR2,2000,0,0\nR3,-1000,2000,0\nR4,-1000,0,1500\nR5,-100,800,700\n";
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
  const std::string points =
      folder_.write("sa.txt", "// Units: inches\nMain b 1 2 3\nMain a 4 5 6\n");
  const std::string plan = folder_.write("plan.csv", "pose_id,q1_deg\na,10\nb,20\nc,30\n");
  const std::string batch = folder_.file("batch.csv");
  ASSERT_EQ(trammel({"convert", "--points", points, "--joints", plan, "--tool", "probe", "-o",
                     batch, "--json", folder_.file("out.json")}),
            0);
  const MeasurementBatch read = test::demand(read_batch_csv(batch));
  ASSERT_EQ(read.measurements.size(), 2u);
  EXPECT_EQ(read.measurements[0].pose_id, "b");
  EXPECT_EQ(read.measurements[0].context.tool, "probe");
  EXPECT_NEAR(read.measurements[0].p_W.x(), 0.0254, 1e-12);
  EXPECT_EQ(json("out.json")["not_measured"], 1);
}

TEST_F(MeasurementCommands, ConvertReadsLeicaTrackerPilotBesideThePlan) {
  const std::string points = folder_.write(
      "leica.csv",
      "Leica Tracker Pilot;AT960\nOperator;Ada\n"
      "Point ID;X [mm];Y [mm];Z [mm];U95 [mm];Q0;Q1;Q2;Q3;Timestamp;Temperature [\xC2\xB0"
      "C];Pressure [hPa];Humidity [%]\n"
      "p2;1520,013;310,552;1204,871;0,0346410;0,5;0,5;0,5;0,5;2026-11-22 "
      "10:11:12.5;20,4;1013,2;41\n"
      "p1;-3,5;2;1;;1;0;0;0;22.11.2026 10:11:20;20,5;1013,2;41\n");
  const std::string plan = folder_.write("plan.csv", "pose_id,q1_deg\np1,10\np2,20\n");
  ASSERT_EQ(
      trammel({"convert", "--points", points, "--joints", plan, "-o", folder_.file("batch.csv")}),
      0);
  const MeasurementBatch read = test::demand(read_batch_csv(folder_.file("batch.csv")));
  ASSERT_EQ(read.measurements.size(), 2u);
  const Measurement& first = read.measurements[0];
  EXPECT_EQ(first.pose_id, "p2");
  EXPECT_TRUE(first.p_W.isApprox(Vector3(1.520013, 0.310552, 1.204871), 1e-12));
  EXPECT_NEAR(first.sigma.value(), 1e-5, 1e-10) << "U95 of three axes, k = 2";
  EXPECT_TRUE(first.R_WT.value().isApprox(Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5).toRotationMatrix(),
                                          1e-12));
  EXPECT_NEAR(first.context.time.value(), 1795342272.5, 1e-6);
  EXPECT_NEAR(read.measurements[1].context.time.value() - first.context.time.value(), 7.5, 1e-6);
  EXPECT_FALSE(read.measurements[1].sigma);
  EXPECT_FALSE(first.context.temperature) << "the air is not the arm";
  ASSERT_GE(read.extra_columns.size(), 3u);
  EXPECT_EQ(read.extra_columns[0], "air_temperature_c");
  EXPECT_EQ(first.extra[0], "20.4");
}

TEST_F(MeasurementCommands, ConvertJoinsPointsInTheirOrderWhereNamesSayNothing) {
  const std::string points =
      folder_.write("leica.csv", "Point ID;X [mm];Y [mm];Z [mm]\n17;1;2;3\n18;4;5;6\n");
  const std::string plan = folder_.write("plan.csv", "pose_id,q1_deg\na,10\nb,20\n");
  const std::vector<std::string> by_name = {
      "convert", "--points", points, "--joints", plan, "-o", folder_.file("batch.csv")};
  EXPECT_EQ(trammel(by_name), 3);
  std::vector<std::string> in_order = by_name;
  in_order.emplace_back("--in-order");
  ASSERT_EQ(trammel(in_order), 0);
  const MeasurementBatch read = test::demand(read_batch_csv(folder_.file("batch.csv")));
  EXPECT_EQ(read.measurements.at(1).pose_id, "b");
  EXPECT_NEAR(read.measurements.at(1).p_W.x(), 4e-3, 1e-15);
  folder_.write("plan.csv", "pose_id,q1_deg\na,10\nb,20\nc,30\n");
  EXPECT_EQ(trammel(in_order), 3) << "another number of poses";
}

TEST_F(MeasurementCommands, ConvertReadsATableWithoutAHeaderByItsColumns) {
  const std::string table = folder_.write(
      "log.txt", "# recorded by hand\n17 0.5 -1.5 1.52 0.31 1.2\n18 0.6 -1.4 1.5 0.3 1.1\n");
  const std::string batch = folder_.file("batch.csv");
  ASSERT_EQ(trammel({"convert", "--table", table, "--columns", "skip,q1_rad,q2_rad,x_m,y_m,z_m",
                     "-o", batch}),
            0);
  const MeasurementBatch read = test::demand(read_batch_csv(batch));
  ASSERT_EQ(read.measurements.size(), 2u);
  EXPECT_NEAR(read.measurements[0].context.q(1), -1.5, 1e-11);
  EXPECT_NEAR(read.measurements[1].p_W.z(), 1.1, 1e-12);
  EXPECT_EQ(
      trammel({"convert", "--table", table, "--columns", "q1_rad,q2_rad,x_m,y_m,z_m", "-o", batch}),
      3);
  EXPECT_EQ(trammel({"convert", "--table", table, "-o", batch}), 2);
  const std::string commas = folder_.write("log2.txt", "0,5;-1,5;1520,5;310;1200\n");
  ASSERT_EQ(trammel({"convert", "--table", commas, "--columns", "q1_deg,q2_deg,x_mm,y_mm,z_mm",
                     "-o", batch}),
            0);
  EXPECT_NEAR(test::demand(read_batch_csv(batch)).measurements.at(0).p_W.x(), 1.5205, 1e-12);
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
  EXPECT_EQ(
      trammel({"convert", "--points", points, "--joints", plan, "--unit", "feet", "-o", batch}), 2);
  EXPECT_EQ(trammel({"convert", "--points", points, "--joints", plan, "-o", batch}), 3);
  EXPECT_FALSE(std::filesystem::exists(batch));
}

TEST_F(MeasurementCommands, ReferencesMoveABatchIntoTheOldFrame) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured =
      folder_.write("now.csv", std::string("name,x_mm,y_mm,z_mm\n") + kMoved);
  const std::string batch = folder_.write("batch.csv", kBatch);
  ASSERT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch,
                     "-o", folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            0);
  EXPECT_NEAR(test::demand(read_batch_csv(folder_.file("there.csv"))).measurements.at(0).p_W.x(),
              1.001, 1e-9);
  const nlohmann::json out = json("out.json");
  EXPECT_EQ(out["verdict"], "localise_and_repeat");
  EXPECT_NEAR(out["rms_mm"], 1000, 1e-6);
  EXPECT_NEAR(out["rms_remaining_mm"], 0, 1e-6);
  EXPECT_NEAR(out["transform"]["xyz_mm"][0], 1000, 1e-6);
  EXPECT_EQ(out["reflectors"].size(), 5u);
}

TEST_F(MeasurementCommands, ReferencesLeaveABatchAsItIsWhenAllIsFine) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured = folder_.write(
      "now.csv",
      "name,x_mm,y_mm,z_mm\nR1,0.01,0,0\nR2,3000.01,0,0\nR3,0.01,2000,0\nR4,0.01,0,1500\n");
  const std::string batch = folder_.write("batch.csv", kBatch);
  ASSERT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch,
                     "-o", folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            0);
  EXPECT_EQ(json("out.json")["verdict"], "fine");
  EXPECT_EQ(json("out.json")["not_measured"], nlohmann::json({"R5"}));
  EXPECT_NEAR(test::demand(read_batch_csv(folder_.file("there.csv"))).measurements.at(0).p_W.x(),
              1e-3, 1e-15);
}

TEST_F(MeasurementCommands, ReferencesThatMovedAgainstEachOtherLocaliseNothing) {
  const std::string nominal = folder_.write("refs.csv", kReferences);
  const std::string measured = folder_.write(
      "now.csv",
      "name,x_mm,y_mm,z_mm\nR1,0,0,0\nR2,3000,0,0\nR3,0,2000,0\nR4,0,0,1500\nR5,905,800,700\n");
  const std::string batch = folder_.write("batch.csv", kBatch);
  EXPECT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch,
                     "-o", folder_.file("there.csv"), "--json", folder_.file("out.json")}),
            3);
  EXPECT_FALSE(std::filesystem::exists(folder_.file("there.csv")));
  EXPECT_EQ(json("out.json")["rigid"], false);
  EXPECT_EQ(json("out.json")["worst"], "R5");
  EXPECT_EQ(trammel({"references", "--nominal", nominal, "--measured", measured, "--batch", batch}),
            2);
}

}  // namespace
}  // namespace trammel::cli
