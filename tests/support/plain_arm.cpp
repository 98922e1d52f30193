#include "tests/support/plain_arm.h"

#include <random>

#include "server/base/check.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

using Eigen::Index;

constexpr double kRight = 1.5707963267948966;

Eigen::Isometry3d tip(const PlainArm& arm, const JointVector& q, const Vector3& tool) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  for (std::size_t i = 0; i < arm.links.size(); ++i) {
    const PlainLink& link = arm.links[i];
    X.rotate(Eigen::AngleAxisd(link.theta + q(static_cast<Index>(i)), Vector3::UnitZ()));
    X.translate(Vector3(link.a, 0, link.d));
    X.rotate(Eigen::AngleAxisd(link.alpha, Vector3::UnitX()));
  }
  X.translate(tool);
  return X;
}

/// The distance from the pose at `q` to the tip at `at`: m, and rad at 0.3 m.
Eigen::VectorXd away(const PlainArm& arm, const Eigen::Isometry3d& at, const JointVector& q) {
  const Eigen::Isometry3d X = tip(arm, q, plain_tool());
  const Eigen::AngleAxisd turn(at.linear() * X.linear().transpose());
  Eigen::VectorXd off(6);
  off << at.translation() - X.translation(), 0.3 * turn.angle() * turn.axis();
  return off;
}

/// `q` with the tip at `at`, the third joint as it is.
JointVector brought(const PlainArm& arm, const Eigen::Isometry3d& at, JointVector q) {
  constexpr double kStep = 1e-6;
  constexpr int kSteps = 50;
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd off = away(arm, at, q);
    Eigen::MatrixXd J(6, q.size());
    for (Index j = 0; j < q.size(); ++j)
      J.col(j) = (away(arm, at, q + kStep * JointVector::Unit(q.size(), j)) - off) / kStep;
    J.col(2).setZero();
    Eigen::VectorXd by = J.completeOrthogonalDecomposition().solve(-off);
    by *= std::min(1.0, 0.2 / std::max(by.cwiseAbs().maxCoeff(), 1e-12));
    q += by;
  }
  TRAMMEL_CHECK(away(arm, at, q).norm() < 1e-6);
  return q;
}

}  // namespace

PlainArm iiwa() {
  return {"kuka_lbr-iiwa-7-r800.yaml",
          {{0, 0.34, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.4, 0, kRight},
           {0, 0, 0, -kRight},
           {0, 0.4, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.126, 0, 0}}};
}

PlainArm irb120() {
  return {"abb_irb120-3-06.yaml",
          {{0, 0.29, 0, -kRight},
           {-kRight, 0, 0.27, 0},
           {0, 0, 0.07, -kRight},
           {2 * kRight, 0.302, 0, -kRight},
           {0, 0, 0, kRight},
           {0, 0.072, 0, 0}}};
}

Vector3 plain_tool() { return {0.04, -0.025, 0.14}; }

MeasurementBatch measured(const PlainArm& arm, const PlainCheck& check) {
  std::mt19937_64 random(check.seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Vector3(sigma * Vector3(normal(random), normal(random), normal(random)));
  };
  MeasurementBatch batch;
  batch.id = "plain-arm";
  for (const JointVector& q : check.poses) {
    const Eigen::Isometry3d X_WT = check.X_WB * tip(arm, q + check.zeros, check.tool);
    Measurement m;
    m.pose_id = fmt::format("p{}", batch.measurements.size() + 1);
    m.row = static_cast<int>(batch.measurements.size()) + 2;
    m.context.q = q;
    m.context.tool = "tip";
    m.p_W = X_WT.translation() + noise(0.013e-3);
    if (check.orientation) {
      const Vector3 turn = noise(5e-5);
      m.R_WT = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * X_WT.linear();
    }
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

CompensatedModel trained(const PlainArm& arm, const Vector3& tool) {
  constexpr int kPoses = 100;
  const std::string text = fmt::format(
      "version: 1\ncell: plain\nrobot: robot.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, "
      "0]}}\n"
      "tools: {{tip: {{xyz_mm: [{}, {}, {}], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.013, sigma_deg: 0.003}}\nmodel: {{error_sources: [base, geometry], "
      "bias: none}}\n",
      to_mm(tool.x()), to_mm(tool.y()), to_mm(tool.z()));
  const auto cell = std::make_shared<const Cell>(demand(parse_cell(
      text, demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/" + arm.file)), "cell.yaml")));
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-1.1, 1.1);
  const auto joints = static_cast<Index>(arm.links.size());
  PlainCheck poses{{}, JointVector::Zero(joints)};
  poses.tool = tool;
  for (int k = 0; k < kPoses; ++k)
    poses.poses.push_back(JointVector::NullaryExpr(joints, [&] { return angle(random); }));
  TrainOptions options;
  options.bias = "none";
  return demand(
      train(cell, demand(check_against_cell(measured(arm, poses), *cell, drawn(0.2, 1))), options));
}

std::vector<JointVector> elbows(const PlainArm& arm, int count, const JointVector& like) {
  const Eigen::Isometry3d at = tip(arm, like, plain_tool());
  std::vector<JointVector> all;
  JointVector q = like;
  for (int k = 0; k < count; ++k) {
    q(2) = from_deg(-60 + 120.0 * k / (count - 1));
    q = brought(arm, at, std::move(q));
    all.push_back(q);
  }
  return all;
}

std::vector<JointVector> elbows(const PlainArm& arm, int count) {
  JointVector like(7);
  like << 0.2, 0.6, 0, -1.4, 0, 1.0, 0.1;
  return elbows(arm, count, like);
}

}  // namespace trammel::test
