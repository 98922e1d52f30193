#include "server/health/evidence/working_poses.h"

#include "server/numerics/seeded_random.h"
#include "server/plan/plan.h"

namespace trammel::health {

namespace {

constexpr int kPoses = 200;
constexpr int kLargestDraw = 64;  // times as many where most are outside the workspace

bool inside(const Cell& cell, const PhysicalModel& physics, const PoseContext& context) {
  if (!cell.workspace) return true;
  const Vector3 p = (physics.X_WB.inverse() * physics.nominal_pose_W(context)).translation();
  return (p.array() >= cell.workspace->lower.array()).all() &&
         (p.array() <= cell.workspace->upper.array()).all();
}

}  // namespace

std::vector<PoseContext> working_poses(const CompensatedModel& model, const PoseContext& like,
                                       std::uint64_t seed) {
  const ModelParts& parts = model.parts();
  JointRanges ranges;
  for (Eigen::Index j = 0; j < parts.q_min.size(); ++j)
    ranges.emplace_back(parts.q_min(j), parts.q_max(j));
  std::vector<PoseContext> poses;
  for (int draw = 1; draw <= kLargestDraw && static_cast<int>(poses.size()) < kPoses; draw *= 4) {
    const Eigen::MatrixXd q = latin_hypercube(ranges, draw * kPoses, seed);
    SeededRandom random(seed);
    poses.clear();
    for (Eigen::Index i = 0; i < q.rows() && static_cast<int>(poses.size()) < kPoses; ++i) {
      PoseContext context = like;
      context.q = q.row(i).transpose();
      for (int& direction : context.direction) direction = random.uniform(0, 1) < 0.5 ? -1 : 1;
      if (inside(model.cell(), parts.physics, context)) poses.push_back(std::move(context));
    }
  }
  return poses;
}

}  // namespace trammel::health
