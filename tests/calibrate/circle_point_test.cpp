#include "server/calibrate/instruments/circle_point.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <random>

#include "server/base/units.h"
#include "server/robot/arm_state.h"
#include "server/robot/cell.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Chain shipped(const std::string& file) {
  const Result<Chain> chain = read_robot(TRAMMEL_SOURCE_DIR "/models/" + file);
  EXPECT_TRUE(chain) << (chain ? "" : chain.error().message);
  return *chain;
}

/// The robot as a workshop made it: every length off by some tenths of a mm, every angle by some
/// 0.02 deg.
Chain perturbed(const Chain& nominal, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> length(0, 0.3e-3);
  std::normal_distribution<double> angle(0, from_deg(0.02));
  std::vector<Joint> joints;
  std::vector<Coupling> couplings;
  for (int i = 0; i < nominal.size(); ++i) {
    Joint joint = nominal.joint(i);
    joint.link.theta += angle(random);
    joint.link.a += length(random);
    joint.link.alpha += angle(random);
    if (joint.hayati) {
      joint.link.beta += angle(random);
    } else {
      joint.link.d += length(random);
    }
    joints.push_back(joint);
    for (int j = 0; j < nominal.size(); ++j) {
      if (i != j && nominal.transmission()(i, j) != 0)
        couplings.push_back({i, j, nominal.transmission()(i, j)});
    }
  }
  return *Chain::make(nominal.name(), joints, couplings);
}

/// Where a point of link `joint` (its frame as the row leaves it) stands in B.
Vector3 point_of_link(const Chain& chain, const JointVector& q, int joint, const Vector3& p) {
  Pose X = Pose::Identity();
  const std::vector<LinkGeometry> links = chain.links_at(q);
  for (int i = 0; i <= joint; ++i) {
    const LinkGeometry& link = links[static_cast<std::size_t>(i)];
    X.translate(Vector3(0, 0, link.d));
    X.rotate(Eigen::AngleAxisd(link.theta, Vector3::UnitZ()));
    X.translate(Vector3(link.a, 0, 0));
    X.rotate(Eigen::AngleAxisd(link.alpha, Vector3::UnitX()));
    X.rotate(Eigen::AngleAxisd(link.beta, Vector3::UnitY()));
  }
  return X * p;
}

struct Campaign {
  std::vector<std::vector<double>> angles_deg;  ///< a joint each
  JointVector posture;                          ///< the other joints
  int reflectors = 1;
  double sigma = 0;
};

/// Table 4.1, its doubled last angle of joint 6 taken for +15.
Campaign table_4_1() {
  return {{{15, 0, -15, -30, -45},
           {-45, -30, -15, 0, 15, 30, 40},
           {-60, -30, -15, 0, 15, 30, 60},
           {-90, -60, -30, 0, 30, 60, 90},
           {-60, -30, -15, 0, 15, 30, 60},
           {-15, -8, 0, 8, 15}},
          JointVector::Zero(6),
          1,
          0};
}

/// Twelve angles over the arm's limits or 150 deg to either side, two reflectors a link.
Campaign wide(const Chain& robot) {
  Campaign campaign;
  campaign.posture = JointVector::Zero(robot.size());
  campaign.reflectors = 2;
  for (int j = 0; j < robot.size(); ++j) {
    const double low = std::max(-150.0, to_deg(robot.joint(j).lower));
    const double high = std::min(150.0, to_deg(robot.joint(j).upper));
    std::vector<double> angles;
    for (int k = 0; k < 12; ++k) angles.push_back(low + (high - low) * k / 11);
    campaign.angles_deg.push_back(angles);
  }
  return campaign;
}

ArcList measured(const Chain& truth, const Campaign& campaign, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  const Pose X_WB = make_pose(rotation_exp({0.2, -0.4, 1.1}), {2.5, -1.2, 0.3});
  ArcList arcs{"arcs.csv", {}};
  for (int joint = 0; joint < truth.size(); ++joint) {
    for (int reflector = 0; reflector < campaign.reflectors; ++reflector) {
      const Vector3 p = reflector == 0 ? Vector3(0.12, 0.25, 0.2) : Vector3(-0.2, 0.15, -0.3);
      for (const double angle : campaign.angles_deg[static_cast<std::size_t>(joint)]) {
        ArcPoint point;
        point.joint = joint;
        point.reflector = std::string(1, static_cast<char>('A' + reflector));
        point.q = campaign.posture;
        point.q(joint) = from_deg(angle);
        point.p_W = X_WB * point_of_link(truth, point.q, joint, p);
        for (int k = 0; k < 3; ++k) point.p_W(k) += campaign.sigma * noise(random);
        point.row = static_cast<int>(arcs.points.size()) + 2;
        arcs.points.push_back(point);
      }
    }
  }
  return arcs;
}

/// The true deviations, by the parameters' names.
std::map<std::string, double> true_deviations(const Chain& nominal, const Chain& truth) {
  std::map<std::string, double> out;
  for (int i = 0; i < nominal.size(); ++i) {
    const LinkGeometry& is = truth.joint(i).link;
    const LinkGeometry& was = nominal.joint(i).link;
    const std::string number = std::to_string(i + 1);
    out["q" + number] = is.theta - was.theta;
    out["d" + number] = is.d - was.d;
    out["a" + number] = is.a - was.a;
    out["alpha" + number] = is.alpha - was.alpha;
    out["beta" + number] = is.beta - was.beta;
  }
  return out;
}

CirclePointResult analysed(const Chain& robot, const ArcList& arcs,
                           const CirclePointOptions& options = {}) {
  const Result<CirclePointResult> result = analyse_circle_points(robot, arcs, options);
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return *result;
}

TEST(CirclePoint, RecoversTheLinksExactlyFromExactArcs) {
  for (const char* file :
       {"abb_irb6640-205-275.yaml", "universal-robots_ur10.yaml", "kuka_kr210-r2700-extra.yaml",
        "fanuc_m-20ia.yaml", "staubli_tx2-90l.yaml", "kuka_lbr-iiwa-7-r800.yaml"}) {
    const Chain nominal = shipped(file);
    const Chain truth = perturbed(nominal, 1);
    const CirclePointResult result =
        analysed(nominal, measured(truth, wide(nominal), 1), {.sigma = 1e-9});
    const auto deviations = true_deviations(nominal, truth);
    for (const MeasuredParameter& parameter : result.parameters) {
      if (!parameter.measured) continue;
      EXPECT_NEAR(parameter.deviation, deviations.at(parameter.name), 1e-9)
          << file << " " << parameter.name;
    }
  }
}

TEST(CirclePoint, UndoesThePostureThatTheOtherJointsAreHeldAt) {
  const Chain nominal = shipped("kuka_kr210-r2700-extra.yaml");
  const Chain truth = perturbed(nominal, 2);
  Campaign campaign = wide(nominal);
  campaign.posture << 0.3, -1.2, 0.8, -0.5, 0.9, 0.4;
  const CirclePointResult result = analysed(nominal, measured(truth, campaign, 1), {.sigma = 1e-9});
  const auto deviations = true_deviations(nominal, truth);
  for (const MeasuredParameter& parameter : result.parameters) {
    if (parameter.measured) {
      EXPECT_NEAR(parameter.deviation, deviations.at(parameter.name), 1e-9) << parameter.name;
    }
  }
}

/// Share of measured parameters within U(k=2) of the truth, over seeds.
double share_within_u(const Campaign& campaign, const CirclePointOptions& options) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  int within = 0;
  int all = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Chain truth = perturbed(nominal, seed);
    const auto deviations = true_deviations(nominal, truth);
    for (const MeasuredParameter& parameter :
         analysed(nominal, measured(truth, campaign, seed), options).parameters) {
      if (!parameter.measured) continue;
      within +=
          std::abs(parameter.deviation - deviations.at(parameter.name)) <= parameter.u ? 1 : 0;
      ++all;
    }
  }
  return static_cast<double>(within) / all;
}

TEST(CirclePoint, StatesUncertaintiesThatHold) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  Campaign narrow = table_4_1();
  Campaign broad = wide(nominal);
  narrow.sigma = broad.sigma = 10e-6;
  for (const Campaign& campaign : {narrow, broad}) {
    for (const CirclePointOptions& options :
         {CirclePointOptions{}, CirclePointOptions{.sigma = 10e-6}}) {
      const double share = share_within_u(campaign, options);
      EXPECT_GT(share, 0.92) << options.sigma.value_or(0);
      EXPECT_LT(share, 0.997) << options.sigma.value_or(0);
    }
  }
}

TEST(CirclePoint, WiderArcsMeasureTheElbowBetter) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  Campaign narrow = table_4_1();
  Campaign broad = wide(nominal);
  narrow.sigma = broad.sigma = 10e-6;
  const auto u_of = [&](const Campaign& campaign, const std::string& name) {
    for (const auto& parameter :
         analysed(nominal, measured(nominal, campaign, 5), {.sigma = 10e-6}).parameters) {
      if (parameter.name == name) return parameter.u;
    }
    return 0.0;
  };
  for (const char* name : {"a2", "a3", "d4", "alpha2"}) {
    EXPECT_GT(u_of(broad, name), 0) << name;
    EXPECT_LT(u_of(broad, name), 0.7 * u_of(narrow, name)) << name;
  }
}

TEST(CirclePoint, FitsSayHowFarThePointsAreFromPlaneAndCircle) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  Campaign campaign = wide(nominal);
  campaign.sigma = 10e-6;
  ArcList arcs = measured(nominal, campaign, 3);
  // Joint 3 as in Table 4.3: ten times as rough as the others.
  std::mt19937_64 random(4);
  std::normal_distribution<double> rough(0, 100e-6);
  for (ArcPoint& point : arcs.points) {
    if (point.joint == 2) point.p_W += Vector3(rough(random), rough(random), rough(random));
  }
  const CirclePointResult result = analysed(nominal, arcs, {.sigma = 10e-6});
  ASSERT_EQ(result.circles.size(), 12u);
  for (const CircleFit& circle : result.circles) {
    const double sigma = circle.joint == 2 ? 100e-6 : 10e-6;
    EXPECT_GT(circle.plane_rms, 0.4 * sigma) << circle.joint;
    EXPECT_LT(circle.plane_rms, 1.6 * sigma) << circle.joint;
    EXPECT_GT(circle.circle_rms, 0.4 * sigma) << circle.joint;
    EXPECT_LT(circle.circle_rms, 1.6 * sigma) << circle.joint;
  }
  // The stated sigma is raised where the arc is rougher, and with it the uncertainty.
  EXPECT_GT(result.axes[2].sigma, 70e-6);
  EXPECT_GT(result.axes[2].direction_u, 4 * result.axes[1].direction_u);
}

TEST(CirclePoint, SaysWhatArcsCannotShow) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  const CirclePointResult result =
      analysed(nominal, measured(perturbed(nominal, 1), wide(nominal), 1));
  std::string missing;
  for (const MeasuredParameter& parameter : result.parameters) {
    EXPECT_EQ(parameter.measured, parameter.note.empty());
    if (!parameter.measured) missing += parameter.name + " ";
  }
  EXPECT_EQ(missing, "q1 d1 q6 d6 a6 alpha6 ");
}

TEST(CirclePoint, TheMeasuredRobotAndBasePutReflectorsWhereTheyWereSeen) {
  const Chain nominal = shipped("fanuc_m-20ia.yaml");
  const ArcList arcs = measured(perturbed(nominal, 3), wide(nominal), 1);
  const CirclePointResult result = analysed(nominal, arcs, {.sigma = 1e-9});
  // A point of link 3 as the first position of its arc shows it, carried along by the measured
  // robot.
  const Pose X_BW = result.X_WB.inverse();
  std::optional<Vector3> p_link;
  for (const ArcPoint& point : arcs.points) {
    if (point.joint != 2 || point.reflector != "A") continue;
    const Vector3 origin = point_of_link(result.robot, point.q, 2, Vector3::Zero());
    Matrix3 R;
    for (int k = 0; k < 3; ++k)
      R.col(k) = point_of_link(result.robot, point.q, 2, Vector3::Unit(k)) - origin;
    if (!p_link) p_link = R.transpose() * (X_BW * point.p_W - origin);
    EXPECT_LT((result.X_WB * point_of_link(result.robot, point.q, 2, *p_link) - point.p_W).norm(),
              1e-8);
  }
  EXPECT_TRUE(p_link);
}

TEST(CirclePoint, RefusesWithRowValueAndLimit) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  const ArcList good = measured(nominal, table_4_1(), 1);
  const auto refusal = [&](const ArcList& arcs, const Chain& robot) {
    const Result<CirclePointResult> result = analyse_circle_points(robot, arcs, {});
    EXPECT_FALSE(result);
    return refusal_of(result);
  };
  ArcList missing = good;
  std::erase_if(missing.points, [](const ArcPoint& point) { return point.joint == 3; });
  EXPECT_EQ(refusal(missing, nominal), Refusal(good.where, {}, "joint").value(4));
  ArcList few = good;
  few.points.erase(few.points.begin());
  EXPECT_EQ(refusal(few, nominal), Refusal(good.where, 3, "joint").beyond(4, 5));
  ArcList moved = good;
  moved.points[6].q(4) = 0.1;
  EXPECT_EQ(refusal(moved, nominal), Refusal(good.where, 8, "q5_deg").beyond(5.72958, 0));
  ArcList wrong_angle = good;
  wrong_angle.points[6].q(1) += from_deg(3);
  EXPECT_EQ(refusal(wrong_angle, nominal), Refusal(good.where, 8, "q_deg").beyond(2.57143, 1));
  ArcList line = good;
  for (ArcPoint& point : line.points) {
    if (point.joint == 1) point.p_W = Vector3(point.q(1), 0, 0);
  }
  EXPECT_EQ(refusal(line, nominal), Refusal(good.where, 7, "joint").value(2));
  EXPECT_EQ(refusal(good, shipped("abb_irb1200-5-09.yaml")),
            Refusal(good.where, {}, "a1").beyond(320, 100));
  EXPECT_EQ(refusal(good, shipped("abb_irb6640-205-275-on-rail.yaml")),
            Refusal(good.where, 2).beyond(6, 7));
}

/// Checks the numbers of `result` that are measured; returns the names of the others.
std::string expect_measured(const CirclePointResult& result,
                            const std::map<std::string, double>& deviations) {
  std::string missing;
  for (const MeasuredParameter& parameter : result.parameters) {
    if (!parameter.measured) {
      missing += parameter.name + " ";
    } else {
      EXPECT_NEAR(parameter.deviation, deviations.at(parameter.name), 1e-9) << parameter.name;
    }
  }
  return missing;
}

bool says(const CirclePointResult& result, const std::string& part) {
  return std::any_of(result.notes.begin(), result.notes.end(),
                     [&](const Note& note) { return note.text.find(part) != std::string::npos; });
}

std::vector<Joint> joints_of(const Chain& robot) {
  std::vector<Joint> joints;
  for (int i = 0; i < robot.size(); ++i) joints.push_back(robot.joint(i));
  return joints;
}

TEST(CirclePoint, ARowWithParallelAxesIsToldAsAHayatiRowWhateverTheFileHas) {
  const Chain nominal = shipped("abb_irb6640-205-275.yaml");
  const Chain truth = perturbed(nominal, 1);
  std::vector<Joint> plain = joints_of(nominal);
  plain[1].hayati = false;
  const CirclePointResult result =
      analysed(*Chain::make("plain", plain), measured(truth, wide(nominal), 1), {.sigma = 1e-9});
  EXPECT_EQ(expect_measured(result, true_deviations(nominal, truth)), "q1 d1 q6 d6 a6 alpha6 ");
  EXPECT_TRUE(says(result, "hayati: true"));
}

/// A SCARA as its file has it: no Hayati row, and a third joint that slides along the fourth axis.
Chain scara() {
  std::vector<Joint> joints(4);
  joints[0].link = {0, 0.387, 0.325, 0, 0};
  joints[1].link = {0, 0, 0.275, kPi, 0};
  joints[2].type = JointType::kPrismatic;
  for (Joint& joint : joints) {
    joint.lower = from_deg(-105);
    joint.upper = from_deg(105);
  }
  return *Chain::make("scara", joints);
}

/// The SCARA with Hayati rows.
Chain scara_in_hayati_rows() {
  std::vector<Joint> joints = joints_of(scara());
  joints[0].hayati = joints[1].hayati = true;
  joints[0].link.d = 0;
  joints[2].link.d = -0.387;
  return *Chain::make("scara", joints);
}

TEST(CirclePoint, PassesOverAJointThatSlidesAlongTheNextAxis) {
  const Chain rows = scara_in_hayati_rows();
  std::vector<Joint> made = joints_of(perturbed(rows, 4));
  made[2] = rows.joint(2);
  // Nothing marks the height at which tilted axes are apart by a.
  for (const std::size_t j : {0U, 1U}) {
    made[j].link.alpha = rows.joint(static_cast<int>(j)).link.alpha;
    made[j].link.beta = 0;
  }
  const Chain truth = *Chain::make("scara", made);
  Campaign campaign = wide(scara());
  campaign.posture(2) = 0.08;
  const ArcList all = measured(truth, campaign, 1);
  ArcList arcs = all;
  std::erase_if(arcs.points, [](const ArcPoint& point) { return point.joint == 2; });
  const CirclePointResult result = analysed(scara(), arcs, {.sigma = 1e-9});
  EXPECT_EQ(expect_measured(result, true_deviations(rows, truth)), "q1 q4 d4 a4 alpha4 ");
  EXPECT_TRUE(says(result, "joint 3 slides"));
  EXPECT_EQ(refusal_of(analyse_circle_points(scara(), all, {})),
            Refusal(all.where, 50, "joint").value(3));
  arcs.points[30].q(2) = 0.09;
  EXPECT_EQ(refusal_of(analyse_circle_points(scara(), arcs, {})),
            Refusal(arcs.where, 32, "q3_mm").beyond(90, 80));
}

TEST(CirclePoint, TellsTheArmOnARailThatNoArcIsOf) {
  const Chain nominal = shipped("abb_irb6640-205-275-on-rail.yaml");
  std::vector<Joint> made = joints_of(perturbed(nominal, 5));
  made[0] = nominal.joint(0);
  const Chain truth = *Chain::make("arm on a rail", made);
  Campaign campaign = wide(nominal);
  campaign.posture(0) = 1.2;
  ArcList arcs = measured(truth, campaign, 1);
  std::erase_if(arcs.points, [](const ArcPoint& point) { return point.joint == 0; });
  const CirclePointResult result = analysed(nominal, arcs, {.sigma = 1e-9});
  EXPECT_EQ(expect_measured(result, true_deviations(nominal, truth)), "q2 d2 q7 d7 a7 alpha7 ");
  EXPECT_TRUE(says(result, "joint 1 slides"));
}

TEST(CirclePoint, ASlideAcrossTheNextAxisIsRefusedWithWhatElseTellsIt) {
  std::vector<Joint> joints = joints_of(scara());
  joints[2].link.a = 0.1;
  const Chain across = *Chain::make("across", joints);
  ArcList arcs = measured(across, wide(across), 1);
  std::erase_if(arcs.points, [](const ArcPoint& point) { return point.joint == 2; });
  EXPECT_EQ(refusal_of(analyse_circle_points(across, arcs, {})), Refusal("", {}, "joint 3"));
}

TEST(ArcsCsv, ReadsArcsPosturesAndReflectors) {
  const Chain robot = shipped("abb_irb6640-205-275.yaml");
  const Result<ArcList> arcs = parse_arcs_csv(
      "joint,q_deg,x_mm,y_mm,z_mm,reflector,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
      "2,-45,100,200,300,A,10,99,30,40,50,60\n",
      "arcs.csv", robot);
  ASSERT_TRUE(arcs) << arcs.error().message;
  const ArcPoint& point = arcs->points.front();
  EXPECT_EQ(point.joint, 1);
  EXPECT_EQ(point.reflector, "A");
  EXPECT_NEAR(point.q(0), from_deg(10), 1e-12);
  EXPECT_NEAR(point.q(1), from_deg(-45), 1e-12);  // the turning joint's own angle
  EXPECT_NEAR(point.p_W.z(), 0.3, 1e-12);
  const auto refusal = [&](const std::string& text) {
    return refusal_of(parse_arcs_csv(text, "a.csv", robot));
  };
  EXPECT_EQ(refusal("joint,q_deg,x_mm,y_mm\n"), Refusal("a.csv", {}, "z_mm"));
  EXPECT_EQ(refusal("joint,q_deg,x_mm,y_mm,z_mm\n7,0,1,2,3\n"),
            Refusal("a.csv", 2, "joint").beyond(7, 6));
  EXPECT_EQ(refusal("joint,q_deg,x_mm,y_mm,z_mm\n1,0,1,far,3\n"),
            Refusal("a.csv", 2, "y_mm").text("far"));
  EXPECT_EQ(refusal("joint,q_deg,x_mm,y_mm,z_mm,q1_deg\n1,0,1,2,3,0\n"),
            Refusal("a.csv").beyond(1, 6));
}

}  // namespace
}  // namespace trammel
