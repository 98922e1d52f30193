#include "clients/session/convert.h"

#include <nlohmann/json.hpp>

#include "server/base/json_guard.h"

namespace trammel::client {
namespace {

wire::PoseMm to_wire(const PoseMm& pose) {
  wire::PoseMm result;
  result.x_mm(pose.x_mm);
  result.y_mm(pose.y_mm);
  result.z_mm(pose.z_mm);
  result.qw(pose.qw);
  result.qx(pose.qx);
  result.qy(pose.qy);
  result.qz(pose.qz);
  return result;
}

PoseMm from_wire(const wire::PoseMm& pose) {
  return {pose.x_mm(), pose.y_mm(), pose.z_mm(), pose.qw(), pose.qx(), pose.qy(), pose.qz()};
}

const char* text(wire::TargetStatus status) {
  switch (status) {
    case wire::TARGET_OK:
      return "ok";
    case wire::TARGET_OUT_OF_DOMAIN:
      return "out_of_domain";
    case wire::TARGET_JOINT_LIMIT:
      return "joint_limit";
    case wire::TARGET_UNREACHABLE:
      return "unreachable";
    case wire::TARGET_SINGULAR:
      return "singular";
    case wire::TARGET_NOT_CONVERGED:
      return "not_converged";
    case wire::TARGET_REFUSED:
      return "refused";
  }
  return "refused";
}

const char* text(wire::JobStage stage) {
  switch (stage) {
    case wire::JOB_QUEUED:
      return "queued";
    case wire::JOB_TRAINING:
      return "training";
    case wire::JOB_STORING:
      return "storing";
    case wire::JOB_DONE:
      return "done";
    case wire::JOB_FAILED:
      return "failed";
  }
  return "failed";
}

ErrorCode from_wire(wire::ResultCode code) {
  switch (code) {
    case wire::RESULT_UNSUPPORTED:
    case wire::RESULT_INVALID_ARGUMENT:
    case wire::RESULT_UNKNOWN_OPERATION:
      return ErrorCode::kUsage;
    case wire::RESULT_REFUSED:
    case wire::RESULT_WRONG_CONTRACT:
      return ErrorCode::kRefused;
    case wire::RESULT_NOT_FOUND:
      return ErrorCode::kNotFound;
    case wire::RESULT_CONFLICT:
      return ErrorCode::kConflict;
    case wire::RESULT_TOO_LARGE:
      return ErrorCode::kTooLarge;
    case wire::RESULT_OUT_OF_RESOURCES:
    case wire::RESULT_BUSY:
      return ErrorCode::kBusy;
    case wire::RESULT_OK:
    case wire::RESULT_UNKNOWN_EXCEPTION:
    case wire::RESULT_INTERNAL:
      return ErrorCode::kInternal;
  }
  return ErrorCode::kInternal;
}

}  // namespace

wire::Context to_wire(const CallContext& context) {
  wire::Context result;
  result.cell(context.cell);
  result.tool(context.tool);
  result.payload(context.payload);
  result.controller_compensates(context.controller_compensates);
  result.model(context.model);
  return result;
}

wire::Target to_wire(const TargetMm& target) {
  wire::Target result;
  if (target.joint_target) {
    result.kind(wire::TARGET_JOINTS);
  } else {
    result.kind(target.conf ? wire::TARGET_POSE_ON_BRANCH : wire::TARGET_POSE_NEAR_JOINTS);
  }
  result.pose(to_wire(target.pose));
  result.joints_rad(target.seed_rad);
  result.conf(target.conf.value_or(0));
  return result;
}

ModelInfo from_wire(const wire::ModelInfo& info) {
  ModelInfo result;
  result.cell = info.cell();
  result.id = info.id();
  result.hash = info.hash();
  result.level = info.level();
  result.batch_id = info.batch_id();
  result.version = info.version();
  result.trained_at_unix_s = info.trained_at_unix_s();
  result.data_age_s = info.data_age_s();
  result.training_poses = info.training_poses();
  result.validation_rms_mm = info.validation_rms_mm();
  result.in_force = info.in_force();
  return result;
}

PredictedError from_wire(const wire::PredictedError& prediction) {
  PredictedError result;
  result.nominal = from_wire(prediction.nominal());
  result.predicted = from_wire(prediction.predicted());
  result.dx_mm = prediction.dx_mm();
  result.dy_mm = prediction.dy_mm();
  result.dz_mm = prediction.dz_mm();
  result.sx_mm = prediction.sx_mm();
  result.sy_mm = prediction.sy_mm();
  result.sz_mm = prediction.sz_mm();
  result.in_domain = prediction.in_domain();
  return result;
}

CorrectedTarget from_wire(const wire::CorrectedTarget& correction) {
  CorrectedTarget result;
  result.status = text(correction.status());
  result.commanded = from_wire(correction.commanded());
  result.q_rad = correction.joints_rad();
  result.error_before_mm = correction.error_before_mm();
  result.error_after_mm = correction.error_after_mm();
  result.sigma_mm = correction.sigma_mm();
  result.iterations = correction.iterations();
  result.message = correction.message();
  return result;
}

JobStatus from_wire(const wire::Job& job) {
  return {job.number(), job.cell(), text(job.stage()), job.what(), job.share(), job.model_version(), job.in_force()};
}

ServerStatus from_wire(const wire::ServiceStatus& status) {
  ServerStatus result;
  result.server_id = status.server().to_string();
  result.version = status.program_version();
  result.state = status.state() == wire::SERVICE_SERVING ? "serving" : "stopping";
  result.cells = status.cells();
  result.requests = status.requests();
  result.refused = status.refused();
  result.uptime_s = status.uptime_s();
  result.queued_jobs = status.queued_jobs();
  return result;
}

Result<std::vector<QuarantinedBatch>> quarantine_from(const std::string& json) {
  static const std::string kWhat = "the server's list of batches in quarantine";
  if (const Status small = check_json_limits(json, kWhat); !small) return tl::make_unexpected(small.error());
  const auto list = nlohmann::json::parse(json, nullptr, false);
  if (!list.is_array()) return failure(ErrorCode::kInternal, "{} is none", kWhat);
  std::vector<QuarantinedBatch> batches;
  try {
    for (const auto& one : list) {
      batches.push_back(
          {one.value("cell", ""), one.value("batch", ""), one.value("reason", ""), one.value("poses", 0)});
    }
  } catch (const nlohmann::json::exception& error) {
    return failure(ErrorCode::kInternal, "{} is none: {}", kWhat, error.what());
  }
  return batches;
}

std::string release_text(const std::vector<std::string>& batch_ids, const std::string& level, const std::string& bias) {
  return nlohmann::ordered_json({{"batches", batch_ids}, {"level", level}, {"bias", bias}})
      .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

namespace {

DatedJob job_from(const nlohmann::json& one, const std::string& server) {
  const auto time = [&](const char* key) -> std::optional<std::int64_t> {
    if (!one.contains(key) || !one[key].is_number_integer()) return std::nullopt;
    return one[key].get<std::int64_t>();
  };
  DatedJob job;
  job.server = server;
  job.kind = one.value("kind", "");
  job.batches = one.value("batches", std::vector<std::string>());
  job.status = {one.value("job", std::int64_t{0}),
                one.value("cell", ""),
                one.value("stage", ""),
                one.value("what", ""),
                one.value("share", 0.0),
                one.value("model_version", 0),
                one.value("in_force", false)};
  job.created_unix_s = time("created_unix_s").value_or(0);
  job.started_unix_s = time("started_unix_s");
  job.finished_unix_s = time("finished_unix_s");
  return job;
}

}  // namespace

Result<std::vector<DatedJob>> jobs_from(const std::string& json, const std::string& server) {
  const std::string what = fmt::format("the list of jobs of server {}", server);
  if (const Status small = check_json_limits(json, what); !small) return tl::make_unexpected(small.error());
  try {
    std::vector<DatedJob> jobs;
    const auto list = nlohmann::json::parse(json);
    for (const auto& one : list.at("jobs")) jobs.push_back(job_from(one, server));
    return jobs;
  } catch (const nlohmann::json::exception& error) {
    return failure(ErrorCode::kInternal, "{} is none: {}", what, error.what());
  }
}

Error error_of(const wire::ReplyHeader& header) {
  return failure(from_wire(header.result()), "{}", header.message()).value();
}

}  // namespace trammel::client
