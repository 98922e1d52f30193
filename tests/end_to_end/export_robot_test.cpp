#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "server/measurement/files/csv_table.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

// The exported robot is read by kinematics that shares nothing with ours: plain matrices, from the
// URDF's text.
namespace trammel {
namespace {

using nlohmann::json;
using Matrix4 = std::array<std::array<double, 4>, 4>;

constexpr Matrix4 kIdentity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};

Matrix4 product(const Matrix4& a, const Matrix4& b) {
  Matrix4 c{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = 0; k < 4; ++k) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

Matrix4 shift(double x, double y, double z) {
  Matrix4 m = kIdentity;
  m[0][3] = x, m[1][3] = y, m[2][3] = z;
  return m;
}

Matrix4 turn(std::size_t axis, double angle) {
  Matrix4 m = kIdentity;
  const std::size_t a = (axis + 1) % 3, b = (axis + 2) % 3;
  m[a][a] = m[b][b] = std::cos(angle);
  m[a][b] = -std::sin(angle);
  m[b][a] = std::sin(angle);
  return m;
}

struct UrdfJoint {
  std::string name, type, parent, child, leader;
  std::array<double, 6> origin{};
  double axis_z = 1, multiplier = 1;
};

/// The joints of a URDF, by their child links.
std::map<std::string, UrdfJoint> read_urdf(const std::string& text) {
  static const std::regex kJoint(R"re(<joint name="([^"]+)" type="([^"]+)">([\s\S]*?)</joint>)re");
  static const std::regex kParent(R"re(<parent link="([^"]+)"/>)re"),
      kChild(R"re(<child link="([^"]+)"/>)re");
  static const std::regex kOrigin(
      R"re(<origin xyz="(\S+) (\S+) (\S+)" rpy="(\S+) (\S+) (\S+)"/>)re");
  static const std::regex kAxis(R"re(<axis xyz="0 0 (\S+)"/>)re");
  static const std::regex kMimic(R"re(<mimic joint="([^"]+)" multiplier="(\S+)"/>)re");
  std::map<std::string, UrdfJoint> joints;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), kJoint);
       at != std::sregex_iterator(); ++at) {
    const std::string body = (*at)[3];
    UrdfJoint joint{(*at)[1], (*at)[2], "", "", "", {}, 1, 1};
    std::smatch found;
    if (std::regex_search(body, found, kParent)) joint.parent = found[1];
    if (std::regex_search(body, found, kChild)) joint.child = found[1];
    if (std::regex_search(body, found, kOrigin)) {
      for (std::size_t k = 0; k < 6; ++k) joint.origin[k] = std::stod(found[k + 1]);
    }
    if (std::regex_search(body, found, kAxis)) joint.axis_z = std::stod(found[1]);
    if (std::regex_search(body, found, kMimic))
      joint.leader = found[1], joint.multiplier = std::stod(found[2]);
    joints[joint.child] = joint;
  }
  return joints;
}

/// `link` seen from `world`; q in rad (m) by joint name.
Matrix4 pose_of(const std::map<std::string, UrdfJoint>& joints, const std::string& link,
                const std::map<std::string, double>& q) {
  if (link == "world") return kIdentity;
  const UrdfJoint& joint = joints.at(link);
  const auto& o = joint.origin;
  Matrix4 m = product(pose_of(joints, joint.parent, q), shift(o[0], o[1], o[2]));
  m = product(product(product(m, turn(2, o[5])), turn(1, o[4])), turn(0, o[3]));
  if (joint.type == "fixed") return m;
  const double value =
      joint.axis_z *
      (joint.leader.empty() ? q.at(joint.name) : joint.multiplier * q.at(joint.leader));
  return product(m, joint.type == "prismatic" ? shift(0, 0, value) : turn(2, value));
}

/// The tool's position in the base that the controller believes, m.
std::array<double, 3> tool_in_base(const std::map<std::string, UrdfJoint>& joints,
                                   const std::string& tool,
                                   const std::map<std::string, double>& q) {
  const Matrix4 base = pose_of(joints, "controller_base", q), t = pose_of(joints, tool, q);
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) p[i] += base[k][i] * (t[k][3] - base[k][3]);
  }
  return p;
}

class ExportRobot : public testing::Test {
 protected:
  static void must(std::vector<std::string> words) {
    words.insert(words.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    const test::Finished finished = test::run(words);
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
  }

  /// Plans, measures and trains; the model is in cell.model, the predictions at the plan in
  /// where.csv.
  void train(const std::string& robot, const std::string& truth, const std::string& level,
             const std::string& more_tools = "") {
    folder_.write(
        "cell.yaml",
        "version: 1\ncell: c\nrobot: " TRAMMEL_SOURCE_DIR "/models/" + robot +
            "\nbase: {xyz_mm: [100, -200, 300], q_wxyz: [0.8, 0, 0, 0.6]}\ngravity: [0, 0, -1]\n"
            "tools: {" +
            more_tools +
            "drill: {xyz_mm: [100, 0, 150], q_wxyz: [0.8, 0, 0.6, 0]}}\n"
            "payloads: {drill: {mass_kg: 20, cog_mm: [0, 0, 100]}}\ntracker: {sigma_mm: 0.01}\n");
    folder_.write("truth.yaml",
                  "version: 1\nerror_sources:\n" + truth + "noise: {sigma_mm: 0.01}\n");
    must({"plan", "--cell", file("cell.yaml"), "--count", "60", "--tool", "drill", "-o",
          file("plan.csv")});
    must({"simulate", "--cell", file("cell.yaml"), "--truth", file("truth.yaml"), "--plan",
          file("plan.csv"), "--tool", "drill", "-o", file("batch.csv")});
    must({"train", "--cell", file("cell.yaml"), "--batch", file("batch.csv"), "--level", level,
          "--bias", "none", "-o", file("cell.model")});
    must({"predict", "--model", file("cell.model"), "--joints", file("plan.csv"), "--tool", "drill",
          "-o", file("where.csv")});
    must({"export-robot", "--model", file("cell.model"), "-o", file("robot.urdf"), "--table",
          file("robot.csv"), "--json", file("robot.json")});
  }

  /// The distance of the URDF's tool from ours at each pose of the plan, mm.
  std::vector<double> distances_mm() const {
    const auto joints = read_urdf(test::read_file(file("robot.urdf")));
    const CsvTable plan = CsvTable::parse(test::read_file(file("plan.csv")), "plan.csv").value();
    const CsvTable where = CsvTable::parse(test::read_file(file("where.csv")), "where.csv").value();
    std::vector<double> distances;
    for (std::size_t row = 0; row < plan.size(); ++row) {
      std::map<std::string, double> q;
      for (int j = 1; plan.find(fmt::format("q{}_deg", j)) || plan.find(fmt::format("q{}_mm", j));
           ++j) {
        const auto rail = plan.find(fmt::format("q{}_mm", j));
        const std::size_t column = rail ? *rail : *plan.find(fmt::format("q{}_deg", j));
        q[fmt::format("joint_{}", j)] =
            plan.number(row, column).value() * (rail ? 1e-3 : std::acos(-1.0) / 180);
      }
      const auto p = tool_in_base(joints, "tool_drill", q);
      double squares = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double ours =
            where.number(row, where.require(std::array{"x_mm", "y_mm", "z_mm"}[k]).value()).value();
        squares += (1e3 * p[k] - ours) * (1e3 * p[k] - ours);
      }
      distances.push_back(std::sqrt(squares));
    }
    return distances;
  }
  std::string file(const std::string& name) const { return folder_.file(name); }

  test::TemporaryFolder folder_;
};

const std::string kRigid =
    "  base: {x0_mm: 1.5, gamma0_rad: 2e-3}\n  geometry: {q2_rad: 1e-3, a2_mm: -0.4, alpha2_rad: "
    "3e-4, q4_rad: -8e-4}\n";

TEST_F(ExportRobot, AsUrdfHasTheToolWhereOursIsWithinAMicrometre) {
  for (const char* robot : {"abb_irb6640-205-275.yaml", "fanuc_m-20ia.yaml",
                            "abb_irb6640-205-275-on-rail.yaml", "universal-robots_ur10.yaml"}) {
    SCOPED_TRACE(robot);
    train(robot, kRigid, "M2");
    const std::vector<double> distances = distances_mm();
    ASSERT_EQ(distances.size(), 60u);
    for (const double distance : distances) EXPECT_LT(distance, 1e-3);
    EXPECT_TRUE(json::parse(test::read_file(file("robot.json")))["left_out"].empty());
  }
}

TEST_F(ExportRobot, ToolsWhoseNamesAreAlikeInUrdfStayTwo) {
  train("fanuc_m-20ia.yaml", kRigid, "M2",
        "\"a b\": {xyz_mm: [1, 0, 0], q_wxyz: [1, 0, 0, 0]}, a_b: {xyz_mm: [2, 0, 0], q_wxyz: [1, "
        "0, 0, 0]}, ");
  const auto joints = read_urdf(test::read_file(file("robot.urdf")));
  EXPECT_EQ(joints.at("tool_a_b").origin[0], 0.001);
  EXPECT_EQ(joints.at("tool_a_b_2").origin[0], 0.002);
}

TEST_F(ExportRobot, SaysInMillimetresWhatUrdfCannotCarry) {
  train("abb_irb6640-205-275.yaml",
        kRigid +
            "  compliance_linear: {C1_rad_per_nmm: 0, C2_rad_per_nmm: 1e-9, C3_rad_per_nmm: 4e-9, "
            "C4_rad_per_nmm: 0, C5_rad_per_nmm: 0, C6_rad_per_nmm: 0}\n",
        "M3");
  const json said = json::parse(test::read_file(file("robot.json")));
  ASSERT_EQ(said["left_out"].size(), 1u);
  EXPECT_TRUE(said["left_out"][0]["source"].get<std::string>().starts_with("compliance"));
  double squares = 0;
  const std::vector<double> distances = distances_mm();
  for (const double distance : distances) squares += distance * distance;
  const double rms = std::sqrt(squares / static_cast<double>(distances.size()));
  EXPECT_GT(rms, 1e-2);
  EXPECT_NEAR(said["left_out_rms_mm"].get<double>(), rms, 0.3 * rms)
      << "poses drawn elsewhere in the same ranges";
  EXPECT_NE(test::read_file(file("robot.urdf")).find("gearboxes give way"), std::string::npos);
}

TEST_F(ExportRobot, AsRobotFileIsReadBackAsTheSameRobot) {
  train("fanuc_m-20ia.yaml", kRigid, "M2");
  must({"export-robot", "--model", file("cell.model"), "-o", file("robot.yaml")});
  // The calibrated robot and frames in a cell of their own: nothing is left to identify.
  const std::string yaml = test::read_file(file("robot.yaml"));
  std::smatch base, tool;
  ASSERT_TRUE(std::regex_search(yaml, base, std::regex("#   (base: .*)\n")));
  ASSERT_TRUE(std::regex_search(yaml, tool, std::regex("#   (tools: .*)\n")));
  folder_.write("again.yaml", "version: 1\ncell: c\nrobot: robot.yaml\n" + base[1].str() +
                                  "\ngravity: [0, 0, -1]\n" + tool[1].str() +
                                  "\npayloads: {drill: {mass_kg: 20, cog_mm: [0, 0, 100]}}\n");
  must({"evaluate", "--model", file("cell.model"), "--batch", file("batch.csv"), "--json",
        file("ours.json")});
  must({"train", "--cell", file("again.yaml"), "--batch", file("batch.csv"), "--level", "M0",
        "--bias", "none", "-o", file("again.model"), "--json", file("again.json")});
  must({"evaluate", "--model", file("again.model"), "--batch", file("batch.csv"), "--json",
        file("again.json")});
  const json ours = json::parse(test::read_file(file("ours.json")));
  const json again = json::parse(test::read_file(file("again.json")));
  EXPECT_NEAR(again["levels"]["nominal"]["rms_mm"].get<double>(),
              ours["levels"]["calibrated"]["rms_mm"].get<double>(), 1e-4);
}

TEST_F(ExportRobot, AsTableHasNominalAndCalibratedParametersWithTheirUncertainty) {
  train("abb_irb6640-205-275.yaml", kRigid, "M2");
  const CsvTable table = CsvTable::parse(test::read_file(file("robot.csv")), "robot.csv").value();
  EXPECT_EQ(table.size(), 6u + 24u + 6u);
  int with_uncertainty = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const auto number = [&](const char* column) {
      return table.number(row, table.require(column).value()).value();
    };
    EXPECT_NEAR(number("calibrated") - number("nominal"), number("correction"),
                1e-5 + 1e-5 * std::abs(number("correction")));
    with_uncertainty += table.field(row, table.require("u95").value()).empty() ? 0 : 1;
    if (table.field(row, 0) == "joint 2" && table.field(row, 1) == "a") {
      EXPECT_NEAR(number("correction"), -0.4, 0.1);
    }
  }
  EXPECT_GT(with_uncertainty, 10);
}

}  // namespace
}  // namespace trammel
