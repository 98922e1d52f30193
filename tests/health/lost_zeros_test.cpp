// Arms whose lengths are written down here, not read by the project's kinematics: what a check says of their lost
// zeros.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/base/text_file.h"
#include "server/health/health_check.h"
#include "server/trainer/pipeline/train.h"
#include "tests/support/demand.h"

namespace trammel {
namespace {

/// theta, d, a, alpha of a link; m and rad. The second axis of an arm whose second and third axes are parallel has d 0.
struct Link {
  double theta = 0, d = 0, a = 0, alpha = 0;
};
struct Arm {
  std::string file, sources;
  std::vector<Link> links;
};
constexpr double kRight = 1.5707963267948966;

Arm iiwa() {
  return {"kuka_lbr-iiwa-7-r800.yaml",
          "base, geometry",
          {{0, 0.34, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.4, 0, kRight},
           {0, 0, 0, -kRight},
           {0, 0.4, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.126, 0, 0}}};
}
Arm irb120() {
  return {"abb_irb120-3-06.yaml",
          "base, geometry",
          {{0, 0.29, 0, -kRight},
           {-kRight, 0, 0.27, 0},
           {0, 0, 0.07, -kRight},
           {2 * kRight, 0.302, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.072, 0, 0}}};
}
const Vector3 kTool(0.04, -0.025, 0.14);  // m

using Joints = Eigen::VectorXd;

Eigen::Isometry3d tip(const Arm& arm, const Joints& q, const Vector3& tool = kTool) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  for (std::size_t i = 0; i < arm.links.size(); ++i) {
    const Link& link = arm.links[i];
    X.rotate(Eigen::AngleAxisd(link.theta + q(static_cast<Eigen::Index>(i)), Vector3::UnitZ()));
    X.translate(Vector3(link.a, 0, link.d));
    X.rotate(Eigen::AngleAxisd(link.alpha, Vector3::UnitX()));
  }
  X.translate(tool);
  return X;
}

/// Measured with 0.013 mm and 0.05 mrad of noise an axis by an instrument that sees the base at `X_WB`.
MeasurementBatch measured(const Arm& arm, const std::vector<Joints>& poses, const Joints& zeros, bool orientation,
                          const Eigen::Isometry3d& X_WB = Eigen::Isometry3d::Identity(), const Vector3& tool = kTool) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Vector3(sigma * Vector3(normal(random), normal(random), normal(random)));
  };
  MeasurementBatch batch;
  batch.id = "own-arm";
  for (const Joints& q : poses) {
    const Eigen::Isometry3d X_WT = X_WB * tip(arm, q + zeros, tool);
    Measurement m;
    m.pose_id = fmt::format("p{}", batch.measurements.size() + 1);
    m.row = static_cast<int>(batch.measurements.size()) + 2;
    m.context.q = q;
    m.context.tool = "tip";
    m.p_W = X_WT.translation() + noise(0.013e-3);
    if (orientation) {
      const Vector3 turn = noise(5e-5);
      m.R_WT = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * X_WT.linear();
    }
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

CompensatedModel trained(const Arm& arm) {
  const std::string text = fmt::format(
      "version: 1\ncell: own\nrobot: robot.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\n"
      "tools: {{tip: {{xyz_mm: [40, -25, 140], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.013, sigma_deg: 0.003}}\nmodel: {{error_sources: [{}], bias: none}}\n",
      arm.sources);
  const auto cell = std::make_shared<const Cell>(test::demand(
      parse_cell(text, test::demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/" + arm.file)), "cell.yaml")));
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-1.1, 1.1);
  const auto joints = static_cast<Eigen::Index>(arm.links.size());
  std::vector<Joints> poses;
  for (int k = 0; k < 100; ++k) poses.push_back(Joints::NullaryExpr(joints, [&] { return angle(random); }));
  TrainOptions options;
  options.bias = "none";
  return test::demand(train(
      cell, test::demand(check_against_cell(measured(arm, poses, Joints::Zero(joints), true), *cell, drawn(0.2, 1))),
      options));
}

Result<HealthCheck> checked(const CompensatedModel& model, const MeasurementBatch& batch) {
  return check_health(model, test::demand(check_against_cell(batch, model.cell(), drawn(0, 1))), {});
}

/// As far as `q` is from having the tip at `at`: m, and rad at 0.3 m.
Eigen::VectorXd away(const Arm& arm, const Eigen::Isometry3d& at, const Joints& q) {
  const Eigen::Isometry3d X = tip(arm, q);
  const Eigen::AngleAxisd turn(at.linear() * X.linear().transpose());
  Eigen::VectorXd off(6);
  off << at.translation() - X.translation(), 0.3 * turn.angle() * turn.axis();
  return off;
}

/// Fourteen elbows of one pose of the flange: the third joint turns from -60 to 60 degrees.
std::vector<Joints> elbows(const Arm& arm) {
  constexpr double kStep = 1e-6;
  Joints q(7);
  q << 0.2, 0.6, 0, -1.4, 0, 1.0, 0.1;
  const Eigen::Isometry3d at = tip(arm, q);
  std::vector<Joints> all;
  for (int k = 0; k < 14; ++k) {
    q(2) = (-60 + 120.0 * k / 13) / 57.29577951308232;
    for (int step = 0; step < 50; ++step) {
      const Eigen::VectorXd off = away(arm, at, q);
      Eigen::MatrixXd J(6, 7);
      for (Eigen::Index j = 0; j < 7; ++j) J.col(j) = (away(arm, at, q + kStep * Joints::Unit(7, j)) - off) / kStep;
      J.col(2).setZero();
      Joints by = J.completeOrthogonalDecomposition().solve(-off);
      by *= std::min(1.0, 0.2 / std::max(by.cwiseAbs().maxCoeff(), 1e-12));
      q += by;
    }
    EXPECT_LT(away(arm, at, q).norm(), 1e-6);
    all.push_back(q);
  }
  return all;
}

bool is_zero_of(const SingleCause& cause, int joint) {
  return cause.record->spelling == "joint_slip" && cause.joint + 1 == joint;
}

/// Named first, or beside it.
bool names_zero_of(const HealthCheck& check, int joint) {
  if (check.changed.empty()) return false;
  const SeenChange& first = check.changed.front();
  const auto is = [&](const SingleCause& cause) { return is_zero_of(cause, joint); };
  return std::any_of(first.zeros.begin(), first.zeros.end(),
                     [&](const LostZero& zero) { return zero.joint + 1 == joint; }) ||
         std::any_of(first.could_also_be.begin(), first.could_also_be.end(), is);
}

TEST(LostZerosOfElbows, AreNamedByPositionsAloneWhereTheInstrumentStandsAsInTheModel) {
  const Arm arm = iiwa();
  const CompensatedModel model = trained(arm);
  const std::vector<Joints> poses = elbows(arm);
  for (const double by : {0.1, 1.0}) {
    for (int joint = 2; joint <= 6; ++joint) {
      const Joints zeros = by / 57.29577951308232 * Joints::Unit(7, joint - 1);
      const HealthCheck check = test::demand(checked(model, measured(arm, poses, zeros, false)));
      EXPECT_EQ(check.verdict, HealthVerdict::kChanged) << joint << ": " << check.sentence;
      EXPECT_TRUE(names_zero_of(check, joint)) << joint << ": " << check.sentence;
      EXPECT_NE(check.sentence.find("turned as in the model"), std::string::npos) << check.sentence;
    }
  }
}

TEST(LostZerosOfElbows, CannotBeToldByPositionsOfAnInstrumentThatWasMoved) {
  const Arm arm = iiwa();
  Eigen::Isometry3d X_WB = Eigen::Isometry3d::Identity();
  X_WB.translation() = Vector3(0.7, -0.4, 0.2);
  const HealthCheck check =
      test::demand(checked(trained(arm), measured(arm, elbows(arm), 2e-3 * Joints::Unit(7, 3), false, X_WB)));
  EXPECT_EQ(check.verdict, HealthVerdict::kCannotTell) << check.sentence;
  EXPECT_NE(check.sentence.find("spread"), std::string::npos) << check.sentence;
}

TEST(LostZerosOfSixPoses, AreNamedThoughTheFileWouldFitBetterReadOtherwise) {
  const Arm arm = irb120();
  const std::vector<std::vector<double>> angles = {
      {1.3792, 0.0094, 0.3825, -0.7798, 0.5230, -2.0421},  {2.2160, 0.6580, 0.6713, 0.7060, 0.6040, 1.9026},
      {2.2858, -0.3932, -0.8614, 1.1248, -0.0612, 2.3713}, {0.2870, -1.2029, -1.4952, 1.1175, -0.5163, -1.0590},
      {0.8097, -0.7946, -0.6656, -0.5403, 0.9376, 1.0432}, {1.9383, -0.6781, 0.8978, 0.1876, -0.4608, 2.0941}};
  std::vector<Joints> poses;
  for (const auto& q : angles) poses.emplace_back(Eigen::Map<const Joints>(q.data(), 6));
  Joints zeros(6);
  zeros << 0, -0.03052, 0, -0.031006, 0.031806, 0;  // rad
  const auto check = checked(trained(arm), measured(arm, poses, zeros, true, Eigen::Isometry3d::Identity(),
                                                    kTool + Vector3(0.53e-3, 0.52e-3, 0.16e-3)));
  ASSERT_TRUE(check) << check.error().message;
  ASSERT_FALSE(check->changed.empty()) << check->sentence;
  EXPECT_EQ(check->changed.front().zeros.size(), 3u) << check->sentence;
}

}  // namespace
}  // namespace trammel
