#include "server/compensate/file/self_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "server/compensate/file/json_values.h"

namespace trammel::model_file {
namespace {

constexpr std::size_t kMostPoses = 10;  // of a self test: each costs a prediction
constexpr double kMostJoint = 1e6;      // rad, m
constexpr double kFarthestPoint = 1e6;

struct TestPose {
  JointVector q;
  std::string tool, payload;
};

/// Three poses in the range of the training: its middle, and two with each joint elsewhere. Then
/// one beside the range.
std::vector<TestPose> test_poses(const CompensatedModel& model) {
  const ModelParts& parts = model.parts();
  std::vector<TestPose> poses;
  if (parts.physics.tools.empty()) return poses;
  TestPose pose{{}, parts.physics.tools.begin()->first, ""};
  if (!parts.trained_with.empty()) std::tie(pose.tool, pose.payload) = *parts.trained_with.begin();
  const JointVector range = parts.q_max - parts.q_min;
  for (const double step : {0.0, 0.21, 0.37}) {
    pose.q = parts.q_min;
    for (Eigen::Index i = 0; i < range.size(); ++i) {
      const double place = 0.5 + step * static_cast<double>(i + 1);
      pose.q(i) += (place - std::floor(place)) * range(i);
    }
    poses.push_back(pose);
  }
  pose.q = parts.q_max + 0.1 * range;
  poses.push_back(pose);
  return poses;
}

Json stated(const TestPose& pose, const ErrorPrediction& prediction) {
  return {{"q", matrix_json(pose.q)},
          {"tool", pose.tool},
          {"payload", pose.payload},
          {"X_BT", pose_json(prediction.X_BT_predicted)},
          {"error_m", matrix_json(prediction.error_B)},
          {"stddev_m", matrix_json(prediction.stddev_B)}};
}

ErrorPrediction predict(const CompensatedModel& model, const TestPose& pose) {
  return model.predict(pose.q, pose.tool, pose.payload);
}

Result<TestPose> pose_of(const Json& json, const CompensatedModel& model) {
  TestPose pose{vector_from(json.at("q")), json.at("tool"), json.at("payload")};
  const Cell& cell = model.cell();
  if (pose.q.size() != cell.robot.size() || pose.q.cwiseAbs().maxCoeff() > kMostJoint)
    return refused("model: its self test has joints that its robot has not").of("self_test");
  if (!model.parts().physics.tools.contains(pose.tool) ||
      (!pose.payload.empty() && !cell.payloads.contains(pose.payload)))
    return refused(
               "model: its self test is with tool '{}' and payload '{}', which its cell does not "
               "have",
               pose.tool, pose.payload)
        .of("self_test")
        .with_text(pose.tool);
  return pose;
}

/// A difference and its limit, m; rotations count as lengths at an arm of 1 m.
struct Difference {
  double off = 0;
  double limit = 0;
};

/// The worst of pose, error and standard deviation, each by its own limit.
Difference worst_of(const ErrorPrediction& now, const Json& stated) {
  const auto largest = [](const Eigen::MatrixXd& difference) {
    // maxCoeff() ignores values that are not numbers.
    return difference.allFinite() ? difference.cwiseAbs().maxCoeff()
                                  : std::numeric_limits<double>::infinity();
  };
  const double of_error = kErrorShare * now.error_B.norm() + kSelfTestMetres;
  const Vector3 above = now.stddev_B - vector3_from(stated.at("stddev_m"));
  if (!above.allFinite()) return {std::numeric_limits<double>::infinity(), 0};
  const auto of_stddev = [&](double share) {
    return share * now.stddev_B.norm() + kSelfTestMetres;
  };
  const std::array<Difference, 4> all = {
      {{largest(now.X_BT_predicted.matrix() - pose_from(stated.at("X_BT")).matrix()), of_error},
       {largest(now.error_B - vector3_from(stated.at("error_m"))), of_error},
       {largest(above.cwiseMax(0.0)), of_stddev(kStddevShare)},
       {largest(above.cwiseMin(0.0)), of_stddev(kStatedMoreShare)}}};
  return *std::max_element(all.begin(), all.end(),
                           [](const Difference& one, const Difference& other) {
                             return one.off / one.limit < other.off / other.limit;
                           });
}

/// True if the numbers are possible lengths.
bool possible(const ErrorPrediction& prediction) {
  const double most = prediction.X_BT_predicted.matrix().norm() + prediction.error_B.norm() +
                      prediction.stddev_B.norm();
  return std::isfinite(most) && most < kFarthestPoint;
}

Status impossible() { return refused("model: predicts what is no length").of("self_test"); }

}  // namespace

Json self_test_of(const CompensatedModel& model) {
  Json list = Json::array();
  for (const TestPose& pose : test_poses(model)) {
    const ErrorPrediction prediction = predict(model, pose);
    if (possible(prediction)) list.push_back(stated(pose, prediction));
  }
  return list;
}

Status check_self_test(const CompensatedModel& model, const Json& self_test) {
  if (list_from(self_test).size() > kMostPoses)
    return failure(ErrorCode::kTooLarge, "model: a self test of {} poses, limit {}",
                   self_test.size(), kMostPoses)
        .of("self_test")
        .beyond(self_test.size(), kMostPoses);
  for (const Json& one : self_test) {
    const TestPose pose = TRY(pose_of(one, model));
    const ErrorPrediction now = predict(model, pose);
    if (!possible(now)) return impossible();
    const auto [off, limit] = worst_of(now, one);
    if (off <= limit) continue;
    return refused(
               "model: predicts otherwise than when it was written, by {:.3g} mm, limit {:.3g} mm",
               1e3 * off, 1e3 * limit)
        .of("self_test")
        .beyond(off, limit)
        .next("train it again");
  }
  return {};
}

}  // namespace trammel::model_file
