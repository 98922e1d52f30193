#include "server/dds/codec.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "idl/exchange/wire_values.h"
#include "server/base/check.h"
#include "server/base/hash.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/exchange/si.h"

namespace trammel {
namespace {

constexpr double kQuaternionTolerance = 1e-3;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kNoTime = -1;
constexpr double kTemperatureLimit = 1e3;      // degrees Celsius, as in files
constexpr std::uint32_t kRetryAfterMs = 1000;  // of a full queue, without a better estimate

constexpr std::int64_t kLastTime = 253'402'300'799;  // the end of the year 9999

double age_s(std::int64_t since_unix_s, std::int64_t now_unix_s) {
  return static_cast<double>(std::max<std::int64_t>(0, now_unix_s - since_unix_s));
}

/// The time, if clients can display it.
std::int64_t told_time(std::int64_t unix_s) {
  return unix_s < 0 || unix_s > kLastTime ? kNoTime : unix_s;
}

/// Sets the times of a model, and the ages that follow from them.
void put_times(std::int64_t trained_at, const std::optional<std::int64_t>& measured_at,
               std::int64_t now_unix_s, wire::ModelInfo& info) {
  const std::int64_t trained = told_time(trained_at);
  const std::int64_t measured = told_time(measured_at.value_or(kNoTime));
  info.trained_at_unix_s(trained);
  info.training_age_s(trained == kNoTime ? kUnknown : age_s(trained, now_unix_s));
  info.measured_at_unix_s(measured);
  info.data_age_s(measured == kNoTime ? kUnknown : age_s(measured, now_unix_s));
  info.valid_until_unix_s(kNoTime);
}

/// A foreign text as a reply can carry it, whatever it is.
std::string told(const std::string& text, std::size_t most_bytes) {
  return cut(shown(text), most_bytes);
}
std::string told_sentence(const std::string& text) {
  return cut(shown_lines(text), wire::MAX_SENTENCE);
}

wire::NoteSeverity to_wire(Note::Severity severity) {
  switch (severity) {
    case Note::Severity::kInfo:
      return wire::NOTE_INFO;
    case Note::Severity::kWarning:
      return wire::NOTE_WARNING;
    case Note::Severity::kStop:
      return wire::NOTE_STOP;
  }
  TRAMMEL_CHECK(false);
}

double mm_or_unknown(const std::optional<double>& length) {
  return length ? to_mm(*length) : kUnknown;
}

}  // namespace

Result<Pose> from_wire(const wire::PoseMm& pose, const std::string& where) {
  const Vector3 p_mm(pose.x_mm(), pose.y_mm(), pose.z_mm());
  const Eigen::Quaterniond rotation(pose.qw(), pose.qx(), pose.qy(), pose.qz());
  if (!p_mm.allFinite() || !rotation.coeffs().allFinite())
    return refused("the pose is not finite").in(where).of("pose");
  if (std::abs(rotation.norm() - 1) > kQuaternionTolerance) {
    return refused("the quaternion has length {:.4f}, must be 1 within {}", rotation.norm(),
                   kQuaternionTolerance)
        .in(where)
        .of("pose")
        .beyond(rotation.norm(), 1);
  }
  return exchange::to_si(wire::from_wire(pose));
}

Result<JointVector> from_wire(const wire::Joints& joints, const Chain& chain,
                              const std::string& where) {
  if (static_cast<int>(joints.size()) != chain.size()) {
    return refused("{} joint values, the robot {} has {}", joints.size(), chain.name(),
                   chain.size())
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

Status read_approach(const wire::Approach& approach, const Chain& chain, const std::string& where,
                     PoseContext& context) {
  const auto& directions = approach.directions();
  if (!directions.empty() && static_cast<int>(directions.size()) != chain.size()) {
    return refused("{} directions, the robot {} has {} joints", directions.size(), chain.name(),
                   chain.size())
        .in(where)
        .of("directions")
        .beyond(directions.size(), chain.size());
  }
  for (const std::int16_t direction : directions) {
    if (direction < -1 || direction > 1)
      return refused("direction {} is not one of -1, 0, 1", direction)
          .in(where)
          .of("directions")
          .with_value(direction);
  }
  for (const auto& [value, field] : {std::pair(approach.temperature_c(), "temperature_c"),
                                     std::pair(approach.time_s(), "time_s")}) {
    if (std::isinf(value))
      return refused("{} is not finite", field).in(where).of(field).with_value(value);
  }
  if (std::abs(approach.temperature_c()) > kTemperatureLimit) {
    return refused("temperature {} C, limit {}", approach.temperature_c(), kTemperatureLimit)
        .in(where)
        .of("temperature_c")
        .beyond(approach.temperature_c(), kTemperatureLimit);
  }
  context.direction.assign(directions.begin(), directions.end());
  if (!std::isnan(approach.temperature_c())) context.temperature = approach.temperature_c();
  if (!std::isnan(approach.time_s())) context.time = approach.time_s();
  return {};
}

std::vector<wire::Note> to_wire(const std::vector<Note>& notes) {
  std::vector<wire::Note> list;
  for (const Note& note : notes) {
    if (list.size() == wire::MAX_NOTES) break;
    list.emplace_back();
    list.back().code(told(note.code, wire::MAX_NAME));
    list.back().severity(to_wire(note.severity));
    list.back().text(told_sentence(note.text));
  }
  return list;
}

std::vector<std::string> budget_to_wire(const ServedModel& served) {
  const auto& budget = served.model.parts().budget;
  std::vector<std::string> lines;
  if (budget) lines = in_words(*budget);
  if (lines.size() > wire::MAX_BUDGET_LINES) lines.resize(wire::MAX_BUDGET_LINES);
  for (std::string& line : lines) line = told_sentence(line);
  return lines;
}

wire::ModelInfo to_wire(const ServedModel& served, bool in_force, std::int64_t now_unix_s) {
  const ModelProvenance& provenance = served.model.provenance();
  const auto& validation = served.model.parts().validation;
  wire::ModelInfo info;
  info.cell(told(served.cell, wire::MAX_ID));
  info.id(told(provenance.id, wire::MAX_ID));
  info.hash(told(provenance.hash, wire::MAX_ID));
  info.level(told(provenance.level, wire::MAX_SPELLING));
  info.batch_id(told(provenance.batch_id, wire::MAX_SENTENCE));
  info.batch_hash(told(provenance.batch_hash, wire::MAX_ID));
  info.version(served.version);
  put_times(provenance.trained_at, provenance.measured_at, now_unix_s, info);
  info.training_poses(provenance.training_poses);
  info.validation_rms_mm(validation ? to_mm(validation->compensated.rms) : kUnknown);
  info.in_force(in_force);
  info.notes(to_wire(served.notes));
  return info;
}

wire::ModelInfo to_wire(const StoredModel& stored, std::int64_t now_unix_s) {
  wire::ModelInfo info;
  info.cell(told(stored.cell, wire::MAX_ID));
  info.id(told(stored.id, wire::MAX_ID));
  info.hash(told(stored.hash, wire::MAX_ID));
  info.level(told(stored.level, wire::MAX_SPELLING));
  info.batch_id(told(stored.batch_id, wire::MAX_SENTENCE));
  info.version(stored.version);
  put_times(stored.trained_at, stored.measured_at, now_unix_s, info);
  info.training_poses(stored.training_poses);
  info.validation_rms_mm(stored.validation_rms > 0 ? to_mm(stored.validation_rms) : kUnknown);
  info.in_force(stored.in_force);
  return info;
}

namespace {

wire::JobVerdict to_wire(JobVerdict verdict) {
  switch (verdict) {
    case JobVerdict::kOpen:
      return wire::VERDICT_OPEN;
    case JobVerdict::kInForce:
      return wire::VERDICT_IN_FORCE;
    case JobVerdict::kNotBetter:
      return wire::VERDICT_NOT_BETTER;
    case JobVerdict::kUndecided:
      return wire::VERDICT_UNDECIDED;
    case JobVerdict::kDiagnosed:
      return wire::VERDICT_DIAGNOSED;
    case JobVerdict::kNothingApplied:
      return wire::VERDICT_NOTHING_APPLIED;
    case JobVerdict::kQuarantined:
      return wire::VERDICT_QUARANTINED;
    case JobVerdict::kRefused:
      return wire::VERDICT_REFUSED;
    case JobVerdict::kOverLimit:
      return wire::VERDICT_OVER_LIMIT;
    case JobVerdict::kBroken:
      return wire::VERDICT_BROKEN;
    case JobVerdict::kCancelled:
      return wire::VERDICT_CANCELLED;
  }
  TRAMMEL_CHECK(false);
}

wire::HeldBack to_wire(HeldBack reason) {
  switch (reason) {
    case HeldBack::kNo:
      return wire::HELD_BACK_NO;
    case HeldBack::kFewJudges:
      return wire::HELD_BACK_FEW_JUDGES;
    case HeldBack::kStopNote:
      return wire::HELD_BACK_STOP_NOTE;
    case HeldBack::kStepLimit:
      return wire::HELD_BACK_STEP_LIMIT;
  }
  TRAMMEL_CHECK(false);
}

wire::JobOutcome to_wire(const JobOutcome& outcome) {
  constexpr double kBytesPerMb = 1 << 20;
  wire::JobOutcome result;
  result.verdict(to_wire(outcome.verdict));
  result.held_back(to_wire(outcome.held_back));
  result.before_mm(mm_or_unknown(outcome.before));
  result.after_mm(mm_or_unknown(outcome.after));
  result.limit_mm(mm_or_unknown(outcome.limit));
  result.u95_mm(kUnknown);
  if (outcome.code) result.code(trammel::to_wire(*outcome.code));
  result.why(told_sentence(outcome.why));
  result.next(told_sentence(outcome.next));
  result.peak_memory_mb(
      outcome.peak_memory ? static_cast<double>(*outcome.peak_memory) / kBytesPerMb : kUnknown);
  result.processor_time_s(outcome.processor_time.value_or(kUnknown));
  return result;
}

}  // namespace

wire::Job to_wire(const JobProgress& progress) {
  wire::Job job;
  job.number(progress.job);
  job.cell(told(progress.cell, wire::MAX_ID));
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
      job.stage(progress.outcome.verdict == JobVerdict::kCancelled ? wire::JOB_CANCELLED
                                                                   : wire::JOB_FAILED);
      break;
  }
  job.what(told_sentence(progress.what));
  job.share(progress.share);
  job.model_version(progress.model_version);
  job.in_force(progress.in_force);
  job.outcome(to_wire(progress.outcome));
  job.created_unix_s(kNoTime);
  job.started_unix_s(kNoTime);
  job.finished_unix_s(kNoTime);
  return job;
}

namespace {

wire::JobKind to_wire(JobKind kind) {
  switch (kind) {
    case JobKind::kTrain:
      return wire::JOB_TRAINING_OF_BATCHES;
    case JobKind::kDiagnose:
      return wire::JOB_DIAGNOSIS;
    case JobKind::kCheck:
      return wire::JOB_CHECK;
  }
  return wire::JOB_TRAINING_OF_BATCHES;
}

}  // namespace

wire::Job to_wire(const Trainer::DatedJob& dated) {
  wire::Job job = to_wire(dated.progress);
  job.kind(to_wire(dated.asked.kind()));
  const std::size_t batches =
      std::min<std::size_t>(dated.asked.batch_ids.size(), wire::MAX_BATCHES);
  for (std::size_t i = 0; i < batches; ++i)
    job.batch_ids().push_back(told(dated.asked.batch_ids[i], wire::MAX_ID));
  job.created_unix_s(dated.asked.created_at);
  job.started_unix_s(dated.asked.started_at.value_or(kNoTime));
  job.finished_unix_s(dated.asked.finished_at.value_or(kNoTime));
  job.server(told(dated.asked.server, wire::MAX_ID));
  return job;
}

wire::BatchInfo to_wire(const StoredBatch& batch) {
  wire::BatchInfo info;
  info.cell(told(batch.cell, wire::MAX_ID));
  info.id(told(batch.id, wire::MAX_ID));
  info.hash(told(batch.hash, wire::MAX_ID));
  info.poses(batch.poses);
  info.accepted_at_unix_s(batch.accepted_at);
  info.quarantine(told_sentence(batch.quarantine));
  info.learned(batch.learned);
  return info;
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

namespace {

wire::Problem to_wire(const Error& error) {
  wire::Problem problem;
  problem.code(trammel::to_wire(error.code));
  problem.what(told_sentence(error.message));
  problem.file(told(error.file, wire::MAX_ID));
  problem.row(error.row.value_or(0));
  problem.field(told(error.field, wire::MAX_ID));
  problem.has_value(error.value.has_value());
  problem.value(error.value.value_or(0));
  problem.has_limit(error.limit.has_value());
  problem.limit(error.limit.value_or(0));
  problem.text(told(error.text, wire::MAX_ID));
  problem.next(told_sentence(error.next));
  return problem;
}

}  // namespace

void put_error(const Error& error, wire::ReplyHeader& header) {
  header.result(to_wire(error.code));
  header.message(told_sentence(sentence(error)));
  if (error.code == ErrorCode::kBusy) header.retry_after_ms(kRetryAfterMs);
  for (const Error& one : apart(error)) {
    if (header.problems().size() < wire::MAX_ERRORS) header.problems().push_back(to_wire(one));
  }
}

void put_error(const wire::Fault& fault, wire::ReplyHeader& header) {
  Error error;
  error.message = fault.what;
  error.file = fault.where;
  error.field = fault.field;
  error.value = fault.value;
  error.limit = fault.limit;
  put_error(error, header);
  header.result(fault.code);
  header.problems().front().code(fault.code);
}

std::string requester(const wire::RequestHeader& header) {
  constexpr std::size_t kOfParticipant = 12;  // octets of a GUID
  std::string text = "client ";
  const auto& guid = header.request_id().writer_guid();
  for (std::size_t i = 0; i < kOfParticipant; ++i) text += fmt::format("{:02x}", guid[i]);
  const std::string trace = header.trace_id().to_string();
  return trace.empty() ? text : text + " " + trace;
}

std::string in_few_words(const std::string& verb, const std::string& cell,
                         const std::vector<std::string>& rest) {
  std::string all;
  for (const std::string& one : rest) all += fmt::format("{}:{}", one.size(), one);
  return fmt::format("{} {} {}", verb, cell, sha256_hex(all));
}

Result<std::optional<int>> expected_version(const wire::Change& change) {
  const int version = change.expected_version();
  if (version == -1) return std::nullopt;
  if (version >= 0) return std::optional(version);
  return failure(ErrorCode::kUsage, "expected version {}, the least is -1", version)
      .of("expected_version")
      .beyond(version, -1);
}

std::string cut(const std::string& text, std::size_t most_bytes) {
  if (text.size() <= most_bytes) return text;
  std::size_t end = most_bytes;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end);
}

std::string request_id_text(const wire::SampleIdentity& id) {
  std::string text;
  for (const std::uint8_t octet : id.writer_guid()) text += fmt::format("{:02x}", octet);
  return fmt::format("{}:{}", text, id.sequence_number());
}

std::int64_t unix_now_s() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace trammel
