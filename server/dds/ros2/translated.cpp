#include "server/dds/ros2/translated.h"

#include <limits>
#include <optional>
#include <utility>

#include "idl/exchange/wire_values.h"
#include "server/base/units.h"

namespace trammel::ros2 {
namespace {

using RosPose = geometry_msgs::msg::dds_::Pose_;

/// Null where this server does not know the cell.
const Chain* robot_of(const std::string& cell, const ServedCells& cells) {
  const auto found = cells.find(cell);
  return found == cells.end() ? nullptr : &found->second->robot;
}

bool is_rail(const Chain* robot, std::size_t joint) {
  return robot != nullptr && static_cast<int>(joint) < robot->size() &&
         robot->joint(static_cast<int>(joint)).type == JointType::kPrismatic;
}

exchange::Pose from_ros(const RosPose& pose) {
  const auto& p = pose.position();
  const auto& q = pose.orientation();
  return {{to_mm(p.x()), to_mm(p.y()), to_mm(p.z())}, {q.w(), q.x(), q.y(), q.z()}};
}

RosPose to_ros(const exchange::Pose& pose) {
  RosPose out;
  out.position().x(from_mm(pose.xyz_mm[0]));
  out.position().y(from_mm(pose.xyz_mm[1]));
  out.position().z(from_mm(pose.xyz_mm[2]));
  out.orientation().w(pose.q_wxyz[0]);
  out.orientation().x(pose.q_wxyz[1]);
  out.orientation().y(pose.q_wxyz[2]);
  out.orientation().z(pose.q_wxyz[3]);
  return out;
}

/// The joints of one of the poses that follow each other in `all`.
wire::Joints joints_of(const std::vector<double>& all, std::size_t n, std::size_t pose,
                       const Chain* robot) {
  wire::Joints joints(n);
  for (std::size_t j = 0; j < n; ++j)
    joints[j] = is_rail(robot, j) ? to_mm(all[n * pose + j]) : all[n * pose + j];
  return joints;
}

wire::Approach nothing_known() {
  wire::Approach approach;
  approach.temperature_c(std::numeric_limits<double>::quiet_NaN());
  approach.time_s(std::numeric_limits<double>::quiet_NaN());
  return approach;
}

wire::Fault misfit(const char* what, const char* field, std::size_t value, std::size_t limit) {
  return {wire::RESULT_INVALID_ARGUMENT,
          fmt::format("{}: {}, needed {}", what, value, limit),
          {},
          field,
          static_cast<double>(value),
          static_cast<double>(limit)};
}

std::optional<wire::Fault> fault_of_joints(std::size_t n, std::size_t numbers, std::size_t poses) {
  if (n < 1 || n > wire::MAX_JOINTS)
    return misfit("joints of one pose, 1 at least", "joints", n, wire::MAX_JOINTS);
  if (poses > wire::MAX_TARGETS)
    return misfit("poses, at most", "joints_rad", poses, wire::MAX_TARGETS);
  if (numbers != n * poses) return misfit("joint values", "joints_rad", numbers, n * poses);
  return std::nullopt;
}

std::size_t count_of(const CorrectTargets_& message) {
  if (!message.poses().empty() || message.joints() == 0) return message.poses().size();
  return message.joints_rad().size() / message.joints();
}

std::optional<wire::Fault> fault_of(const CorrectTargets_& message) {
  const std::size_t count = count_of(message), branches = message.conf().size();
  if (message.joints() != 0) {
    if (branches != 0) return misfit("branches beside joints", "conf", branches, 0);
    return fault_of_joints(message.joints(), message.joints_rad().size(), count);
  }
  if (!message.joints_rad().empty())
    return misfit("joint values without `joints`", "joints_rad", message.joints_rad().size(), 0);
  if (branches != count)
    return misfit("branches where no joints are given", "conf", branches, count);
  return std::nullopt;
}

wire::Target target_of(const CorrectTargets_& message, std::size_t i, const Chain* robot) {
  wire::Target target;
  target.kind(message.poses().empty() ? wire::TARGET_JOINTS
              : message.joints() != 0 ? wire::TARGET_POSE_NEAR_JOINTS
                                      : wire::TARGET_POSE_ON_BRANCH);
  if (!message.poses().empty()) target.pose(wire::to_wire(from_ros(message.poses()[i])));
  if (message.joints() != 0)
    target.joints_rad(joints_of(message.joints_rad(), message.joints(), i, robot));
  if (!message.conf().empty()) target.conf(message.conf()[i]);
  target.approach(nothing_known());
  return target;
}

/// The beginning of both questions.
template <typename Request, typename Message>
std::unique_ptr<wire::Received<Request>> begun(const wire::ReceivedMessage<Message>& message) {
  auto request = std::make_unique<wire::Received<Request>>();
  request->fault = message.fault;
  request->bytes = message.bytes;
  request->content = message.content;
  request->header().server(message.server());
  request->header().trace_id(message.id());
  request->header().contract_version(wire::CONTRACT_VERSION);
  request->header().deadline_ms(message.deadline_ms());
  request->about().cell(message.cell());
  request->about().tool(message.tool());
  request->about().payload(message.payload());
  return request;
}

/// The beginning of both answers.
template <typename Message, typename Reply>
Message begun(const Reply& reply) {
  Message message;
  message.id(reply.header().trace_id().to_string());
  message.server(reply.header().server().to_string());
  message.result(static_cast<std::uint32_t>(reply.header().result()));
  message.message(reply.header().message());
  message.retry_after_ms(reply.header().retry_after_ms());
  message.model_hash(reply.model().hash());
  message.model_version(reply.model().version());
  return message;
}

void add_joints(const wire::Joints& joints, const Chain* robot, std::size_t n,
                std::vector<double>& all) {
  for (std::size_t j = 0; j < n; ++j) {
    const bool known = joints.size() == n;
    all.push_back(!known              ? std::numeric_limits<double>::quiet_NaN()
                  : is_rail(robot, j) ? from_mm(joints[j])
                                      : joints[j]);
  }
}

}  // namespace

std::unique_ptr<wire::Received<wire::PredictErrorRequest>> asked(
    const wire::ReceivedMessage<PredictErrors_>& message, const ServedCells& cells) {
  auto request = begun<wire::PredictErrorRequest>(message);
  const std::size_t n = message.joints(), numbers = message.joints_rad().size();
  const std::size_t poses = n == 0 ? 0 : numbers / n;
  if (!request->fault) request->fault = fault_of_joints(n, numbers, poses);
  if (request->fault) return request;
  const Chain* robot = robot_of(message.cell(), cells);
  request->poses().resize(poses);
  for (std::size_t i = 0; i < poses; ++i) {
    request->poses()[i].joints_rad(joints_of(message.joints_rad(), n, i, robot));
    request->poses()[i].approach(nothing_known());
  }
  return request;
}

std::unique_ptr<wire::Received<wire::CorrectTargetRequest>> asked(
    const wire::ReceivedMessage<CorrectTargets_>& message, const ServedCells& cells) {
  auto request = begun<wire::CorrectTargetRequest>(message);
  if (!request->fault) request->fault = fault_of(message);
  if (request->fault) return request;
  const Chain* robot = robot_of(message.cell(), cells);
  const std::size_t count = count_of(message);
  for (std::size_t i = 0; i < count; ++i)
    request->targets().push_back(target_of(message, i, robot));
  return request;
}

PredictedErrors_ answered(const wire::PredictErrorReply& reply, const ServedCells&) {
  auto message = begun<PredictedErrors_>(reply);
  for (const wire::PredictedError& item : reply.predictions()) {
    const exchange::Prediction prediction = wire::from_wire(item);
    message.nominal().push_back(to_ros(prediction.nominal));
    message.predicted().push_back(to_ros(prediction.predicted));
    for (const double mm : prediction.stddev_mm) message.stddev_m().push_back(from_mm(mm));
    for (const double mm : prediction.true_stddev_mm)
      message.true_stddev_m().push_back(from_mm(mm));
    message.in_domain().push_back(prediction.in_domain);
  }
  return message;
}

CorrectedTargets_ answered(const wire::CorrectTargetReply& reply, const ServedCells& cells) {
  auto message = begun<CorrectedTargets_>(reply);
  const Chain* robot = robot_of(reply.model().cell(), cells);
  const std::size_t n = robot == nullptr ? 0 : static_cast<std::size_t>(robot->size());
  message.joints(static_cast<std::uint32_t>(n));
  for (const wire::CorrectedTarget& item : reply.corrections()) {
    message.status().push_back(static_cast<std::uint8_t>(item.status()));
    message.commanded().push_back(to_ros(wire::from_wire(item.commanded())));
    add_joints(item.joints_rad(), robot, n, message.joints_rad());
    message.error_before_m().push_back(from_mm(item.error_before_mm()));
    message.error_after_m().push_back(from_mm(item.error_after_mm()));
    message.sigma_m().push_back(from_mm(item.sigma_mm()));
    message.messages().push_back(item.message());
  }
  return message;
}

}  // namespace trammel::ros2
