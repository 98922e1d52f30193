#include "clients/cli/files/rigid_robot.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace trammel::cli {

namespace {

constexpr int kPoses = 400;
constexpr double kSame = 1e-12;  // m, rad: two states that differ by rounding alone

/// Poses as requests ask for them, within the range of the training.
std::vector<PoseContext> drawn_poses(const CompensatedModel& model, int count) {
  const ModelParts& parts = model.parts();
  std::mt19937_64 random(1);
  const auto unit = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<std::pair<std::string, std::string>> carried(parts.trained_with.begin(),
                                                           parts.trained_with.end());
  std::vector<PoseContext> poses;
  for (int k = 0; k < count; ++k) {
    PoseContext pose;
    pose.q.resize(parts.q_min.size());
    for (Eigen::Index j = 0; j < pose.q.size(); ++j)
      pose.q(j) = parts.q_min(j) + unit() * (parts.q_max(j) - parts.q_min(j));
    for (Eigen::Index j = 0; j < pose.q.size(); ++j)
      pose.direction.push_back(unit() < 0.5 ? -1 : 1);
    if (!carried.empty())
      std::tie(pose.tool, pose.payload) = carried[static_cast<std::size_t>(k) % carried.size()];
    pose.temperature = parts.temperature_mean;
    pose.served = true;
    poses.push_back(std::move(pose));
  }
  return poses;
}

PhysicalModel without(const PhysicalModel& all, const std::vector<bool>& left_out) {
  PhysicalModel some = all;
  some.sources.clear();
  std::vector<double> values;
  Eigen::Index at = 0;
  for (std::size_t s = 0; s < all.sources.size(); ++s) {
    const auto count = static_cast<Eigen::Index>(all.sources[s]->parameters().size());
    if (!left_out[s]) {
      some.sources.push_back(all.sources[s]);
      for (Eigen::Index k = 0; k < count; ++k) values.push_back(all.values(at + k));
    }
    at += count;
  }
  some.values =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  return some;
}

PhysicalModel only(const PhysicalModel& all, std::size_t source) {
  std::vector<bool> others(all.sources.size(), true);
  others[source] = false;
  return without(all, others);
}

Eigen::VectorXd as_numbers(const ArmState& state, const std::vector<LinkGeometry>& nominal) {
  std::vector<double> numbers;
  for (std::size_t j = 0; j < nominal.size(); ++j) {
    const LinkGeometry &is = state.links[j], &was = nominal[j];
    numbers.insert(numbers.end(), {is.theta - was.theta, is.d - was.d, is.a - was.a,
                                   is.alpha - was.alpha, is.beta - was.beta});
  }
  for (const Pose& X : {state.X_WB, state.X_FT})
    numbers.insert(numbers.end(), X.data(), X.data() + 16);
  numbers.insert(numbers.end(), state.tip_W.data(), state.tip_W.data() + 6);
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(),
                                           static_cast<Eigen::Index>(numbers.size()));
}

/// True if the only effect of the source is to move links, base and tool by constant amounts at all
/// these poses.
bool is_rigid(const PhysicalModel& all, std::size_t source, const std::vector<PoseContext>& poses) {
  const PhysicalModel alone = only(all, source);
  std::map<std::string, Eigen::VectorXd> first;  // of each tool
  for (const PoseContext& pose : poses) {
    const ArmState state = alone.state(pose);
    const Eigen::VectorXd numbers = as_numbers(state, all.cell->robot.links_at(pose.q));
    if (state.tip_W.cwiseAbs().maxCoeff() > kSame) return false;
    const auto [met, is_new] = first.emplace(pose.tool, numbers);
    if (!is_new && (numbers - met->second).cwiseAbs().maxCoeff() > kSame) return false;
  }
  return true;
}

/// The size of a distance over many poses.
struct Size {
  double sum_of_squares = 0, most = 0;
  int count = 0;

  void add(double distance) {
    sum_of_squares += distance * distance;
    most = std::max(most, distance);
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(sum_of_squares / std::max(count, 1)); }
};

Size size_between(const PhysicalModel& a, const PhysicalModel& b,
                  const std::vector<PoseContext>& poses) {
  Size size;
  for (const PoseContext& pose : poses)
    size.add((a.pose_W(pose).translation() - b.pose_W(pose).translation()).norm());
  return size;
}

Vector3 served_position_W(const CompensatedModel& model, const PoseContext& pose) {
  return model.parts().physics.X_WB *
         model.predict(pose.q, pose.tool, pose.payload).X_BT_predicted.translation();
}

}  // namespace

RigidRobot rigid_robot(const CompensatedModel& model) {
  const PhysicalModel& all = model.parts().physics;
  const std::vector<PoseContext> poses = drawn_poses(model, kPoses);
  std::vector<bool> bends(all.sources.size(), false);
  for (std::size_t s = 0; s < all.sources.size(); ++s) bends[s] = !is_rigid(all, s, poses);

  RigidRobot robot;
  robot.physics = without(all, bends);
  robot.poses = kPoses;
  PoseContext zero = poses.front();
  zero.q.setZero();
  robot.nominal = all.cell->robot.links_at(zero.q);
  robot.X_WB_nominal = all.X_WB;
  for (const auto& [name, X_FT] : all.tools) {
    zero.tool = name;
    const ArmState state = robot.physics.state(zero);
    robot.links = state.links;
    robot.X_WB = state.X_WB;
    robot.tools[name] = state.X_FT;
  }
  for (std::size_t s = 0; s < all.sources.size(); ++s) {
    if (!bends[s]) continue;
    std::vector<bool> this_one(all.sources.size(), false);
    this_one[s] = true;
    const Size size = size_between(all, without(all, this_one), poses);
    robot.left_out.push_back(
        {all.sources[s]->name(), all.sources[s]->explanation(), size.rms(), size.most});
  }
  Size bias, together;
  for (const PoseContext& pose : poses) {
    const Vector3 served = served_position_W(model, pose);
    PoseContext asked = pose;
    asked.direction.clear();  // a request of joints alone
    bias.add((served - all.pose_W(asked).translation()).norm());
    together.add((served - robot.physics.pose_W(asked).translation()).norm());
  }
  if (model.bias())
    robot.left_out.push_back({"bias", "what was learned of the rest", bias.rms(), bias.most});
  robot.rms = together.rms();
  robot.most = together.most;
  return robot;
}

}  // namespace trammel::cli
