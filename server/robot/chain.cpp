#include "server/robot/chain.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"

namespace trammel {

namespace {

constexpr double kLeastDeterminant = 1e-6;

}  // namespace

const char* to_string(CouplingKind kind) {
  return kind == CouplingKind::kParallelogram ? "parallelogram" : "controller";
}

Result<Chain> Chain::make(std::string name, std::vector<Joint> joints,
                          std::vector<Coupling> couplings) {
  const int n = static_cast<int>(joints.size());
  if (n == 0) return refused("robot {}: no joints", name).of("joints").beyond(0, 1);
  if (n > kMaxJoints)
    return refused("robot {}: {} joints, limit {}", name, n, kMaxJoints)
        .of("joints")
        .beyond(n, kMaxJoints);
  Chain chain;
  Eigen::VectorXd signs(n);
  for (int i = 0; i < n; ++i) {
    const Joint& joint = joints[static_cast<std::size_t>(i)];
    const bool passive = joint.lower == 0 && joint.upper == 0;
    if (!passive && !(joint.lower < joint.upper)) {
      return refused("robot {} joint {}: lower limit {} is not below upper limit {}", name, i + 1,
                     joint.lower, joint.upper)
          .of(fmt::format("joints {}: limits", i + 1))
          .beyond(joint.lower, joint.upper);
    }
    if (std::abs(joint.sign) != 1.0) {
      return refused("robot {} joint {}: sign is {}, only 1 and -1 are allowed", name, i + 1,
                     joint.sign)
          .of(fmt::format("joints {}: sign", i + 1))
          .with_value(joint.sign);
    }
    signs(i) = joint.sign;
  }
  chain.transmission_ = chain.drive_ = signs.asDiagonal();
  for (const Coupling& coupling : couplings) {
    if (coupling.joint < 0 || coupling.joint >= n || coupling.follows < 0 ||
        coupling.follows >= n || coupling.joint == coupling.follows) {
      return refused("robot {}: coupling of joint {} to joint {} in a robot of {} joints", name,
                     coupling.joint + 1, coupling.follows + 1, n)
          .of("coupling")
          .beyond(std::max(coupling.joint, coupling.follows) + 1, n);
    }
    chain.transmission_(coupling.joint, coupling.follows) += coupling.ratio;
    if (coupling.kind != CouplingKind::kParallelogram) continue;
    chain.drive_(coupling.joint, coupling.follows) += coupling.ratio;
    chain.has_bars_ = true;
  }
  for (const Eigen::MatrixXd* coupled : {&chain.transmission_, &chain.drive_}) {
    if (std::abs(coupled->determinant()) < kLeastDeterminant)
      return refused("robot {}: couplings cannot be inverted", name).of("coupling");
  }
  chain.bars_ = chain.drive_ * signs.asDiagonal();
  chain.couplings_ = std::move(couplings);
  chain.name_ = std::move(name);
  chain.joints_ = std::move(joints);
  return chain;
}

std::vector<LinkGeometry> Chain::links_at(const JointVector& q) const {
  TRAMMEL_CHECK(q.size() == size());
  const JointArray value = transmission_ * q;
  std::vector<LinkGeometry> links;
  links.reserve(joints_.size());
  for (int i = 0; i < size(); ++i) {
    LinkGeometry link = joint(i).link;
    (joint(i).type == JointType::kRevolute ? link.theta : link.d) += value(i);
    links.push_back(link);
  }
  return links;
}

JointVector Chain::gear_angles(const JointVector& q) const {
  if (counts_gears()) return q;
  return drive_.partialPivLu().solve(transmission_ * q);
}

JointVector Chain::commanded(const JointVector& gears) const {
  if (counts_gears()) return gears;
  return transmission_.partialPivLu().solve(drive_ * gears);
}

bool Chain::has_link_masses() const {
  return std::any_of(joints_.begin(), joints_.end(),
                     [](const Joint& joint) { return joint.mass > 0; });
}

std::optional<int> Chain::joint_outside_limits(const JointVector& q, double tolerance) const {
  TRAMMEL_CHECK(q.size() == size());
  for (int i = 0; i < size(); ++i) {
    if (!(q(i) >= joint(i).lower - tolerance && q(i) <= joint(i).upper + tolerance)) return i;
  }
  return std::nullopt;
}

}  // namespace trammel
