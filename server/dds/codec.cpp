#include "server/dds/codec.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"

namespace trammel {
namespace {

constexpr double kQuaternionTolerance = 1e-3;

double age_s(std::int64_t since_unix_s, std::int64_t now_unix_s) {
  return static_cast<double>(std::max<std::int64_t>(0, now_unix_s - since_unix_s));
}

}  // namespace

wire::PoseMm to_wire(const Pose& X) {
  const Eigen::Quaterniond rotation(X.linear());
  wire::PoseMm pose;
  pose.x_mm(to_mm(X.translation().x()));
  pose.y_mm(to_mm(X.translation().y()));
  pose.z_mm(to_mm(X.translation().z()));
  pose.qw(rotation.w());
  pose.qx(rotation.x());
  pose.qy(rotation.y());
  pose.qz(rotation.z());
  return pose;
}

Result<Pose> from_wire(const wire::PoseMm& pose, const std::string& where) {
  const Vector3 p_mm(pose.x_mm(), pose.y_mm(), pose.z_mm());
  const Eigen::Quaterniond rotation(pose.qw(), pose.qx(), pose.qy(), pose.qz());
  if (!p_mm.allFinite() || !rotation.coeffs().allFinite())
    return refused("the pose is not finite").in(where).of("pose");
  if (std::abs(rotation.norm() - 1) > kQuaternionTolerance) {
    return refused("the quaternion has length {:.4f}, must be 1 within {}", rotation.norm(), kQuaternionTolerance)
        .in(where)
        .of("pose")
        .beyond(rotation.norm(), 1);
  }
  return make_pose(rotation.normalized().toRotationMatrix(), p_mm * from_mm(1));
}

wire::Joints to_wire(const JointVector& q, const Chain& chain) {
  wire::Joints joints(static_cast<std::size_t>(q.size()));
  for (int i = 0; i < static_cast<int>(q.size()); ++i) {
    const bool prismatic = i < chain.size() && chain.joint(i).type == JointType::kPrismatic;
    joints[static_cast<std::size_t>(i)] = prismatic ? to_mm(q[i]) : q[i];
  }
  return joints;
}

Result<JointVector> from_wire(const wire::Joints& joints, const Chain& chain, const std::string& where) {
  if (static_cast<int>(joints.size()) != chain.size()) {
    return refused("{} joint values, the robot {} has {}", joints.size(), chain.name(), chain.size())
        .in(where)
        .of("joints_rad")
        .beyond(joints.size(), chain.size());
  }
  JointVector q(chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    const double value = joints[static_cast<std::size_t>(i)];
    if (!std::isfinite(value))
      return refused("joint {} is not finite", i + 1).in(where).of("joints_rad").with_value(value);
    q[i] = chain.joint(i).type == JointType::kPrismatic ? from_mm(value) : value;
  }
  return q;
}

wire::ModelInfo to_wire(const ServedModel& served, bool in_force, std::int64_t now_unix_s) {
  const ModelProvenance& provenance = served.model.provenance();
  const auto& validation = served.model.parts().validation;
  wire::ModelInfo info;
  info.cell(served.cell);
  info.id(provenance.id);
  info.hash(provenance.hash);
  info.level(provenance.level);
  info.batch_id(provenance.batch_id);
  info.version(served.version);
  info.trained_at_unix_s(provenance.trained_at);
  info.data_age_s(age_s(provenance.measured_at.value_or(provenance.trained_at), now_unix_s));
  info.training_poses(provenance.training_poses);
  info.validation_rms_mm(validation ? to_mm(validation->compensated.rms) : 0);
  info.in_force(in_force);
  return info;
}

wire::ModelInfo to_wire(const StoredModel& stored, std::int64_t now_unix_s) {
  wire::ModelInfo info;
  info.cell(stored.cell);
  info.id(stored.id);
  info.hash(stored.hash);
  info.level(stored.level);
  info.batch_id(stored.batch_id);
  info.version(stored.version);
  info.trained_at_unix_s(stored.trained_at);
  info.data_age_s(age_s(stored.measured_at.value_or(stored.trained_at), now_unix_s));
  info.training_poses(stored.training_poses);
  info.validation_rms_mm(to_mm(stored.validation_rms));
  info.in_force(stored.in_force);
  return info;
}

wire::Job to_wire(const JobProgress& progress) {
  wire::Job job;
  job.number(progress.job);
  job.cell(progress.cell);
  switch (progress.stage) {
    case JobStage::kQueued:
      job.stage(wire::JOB_QUEUED);
      break;
    case JobStage::kTraining:
      job.stage(wire::JOB_TRAINING);
      break;
    case JobStage::kStoring:
      job.stage(wire::JOB_STORING);
      break;
    case JobStage::kDone:
      job.stage(wire::JOB_DONE);
      break;
    case JobStage::kFailed:
      job.stage(wire::JOB_FAILED);
      break;
  }
  job.what(progress.what);
  job.share(progress.share);
  job.model_version(progress.model_version);
  job.in_force(progress.in_force);
  return job;
}

wire::TargetStatus to_wire(CorrectionStatus status) {
  switch (status) {
    case CorrectionStatus::kOk:
      return wire::TARGET_OK;
    case CorrectionStatus::kOutOfDomain:
      return wire::TARGET_OUT_OF_DOMAIN;
    case CorrectionStatus::kJointLimit:
      return wire::TARGET_JOINT_LIMIT;
    case CorrectionStatus::kUnreachable:
      return wire::TARGET_UNREACHABLE;
    case CorrectionStatus::kSingular:
      return wire::TARGET_SINGULAR;
    case CorrectionStatus::kNotConverged:
      return wire::TARGET_NOT_CONVERGED;
    case CorrectionStatus::kRefused:
      return wire::TARGET_REFUSED;
  }
  TRAMMEL_CHECK(false);
}

wire::ResultCode to_wire(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return wire::RESULT_INVALID_ARGUMENT;
    case ErrorCode::kRefused:
      return wire::RESULT_REFUSED;
    case ErrorCode::kNotFound:
      return wire::RESULT_NOT_FOUND;
    case ErrorCode::kConflict:
      return wire::RESULT_CONFLICT;
    case ErrorCode::kTooLarge:
      return wire::RESULT_TOO_LARGE;
    case ErrorCode::kBusy:
      return wire::RESULT_BUSY;
    case ErrorCode::kUnreachable:
    case ErrorCode::kInternal:
      return wire::RESULT_INTERNAL;
  }
  TRAMMEL_CHECK(false);
}

std::string request_id_text(const wire::SampleIdentity& id) {
  std::string text;
  for (const std::uint8_t octet : id.writer_guid()) text += fmt::format("{:02x}", octet);
  return fmt::format("{}:{}", text, id.sequence_number());
}

std::int64_t unix_now_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace trammel
