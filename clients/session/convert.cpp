#include "clients/session/convert.h"

#include <cmath>

namespace trammel::client {
namespace {

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
    case wire::JOB_CANCELLED:
      return "cancelled";
  }
  return "failed";
}

const char* text(wire::JobVerdict verdict) {
  switch (verdict) {
    case wire::VERDICT_OPEN:
      return "open";
    case wire::VERDICT_IN_FORCE:
      return "in_force";
    case wire::VERDICT_NOT_BETTER:
      return "not_better";
    case wire::VERDICT_UNDECIDED:
      return "undecided";
    case wire::VERDICT_DIAGNOSED:
      return "diagnosed";
    case wire::VERDICT_NOTHING_APPLIED:
      return "nothing_applied";
    case wire::VERDICT_QUARANTINED:
      return "quarantined";
    case wire::VERDICT_REFUSED:
      return "refused";
    case wire::VERDICT_OVER_LIMIT:
      return "over_limit";
    case wire::VERDICT_BROKEN:
      return "broken";
    case wire::VERDICT_CANCELLED:
      return "cancelled";
  }
  return "open";
}

const char* text(wire::HeldBack reason) {
  switch (reason) {
    case wire::HELD_BACK_NO:
      return "";
    case wire::HELD_BACK_FEW_JUDGES:
      return "few_judges";
    case wire::HELD_BACK_STOP_NOTE:
      return "stop_note";
    case wire::HELD_BACK_STEP_LIMIT:
      return "step_limit";
  }
  return "";
}

const char* text(wire::JobKind kind) {
  switch (kind) {
    case wire::JOB_TRAINING_OF_BATCHES:
      return "train";
    case wire::JOB_DIAGNOSIS:
      return "diagnose";
    case wire::JOB_CHECK:
      return "check";
  }
  return "train";
}

std::optional<double> if_known(double value) {
  return std::isnan(value) ? std::nullopt : std::optional(value);
}
std::optional<std::int64_t> if_known(std::int64_t unix_s) {
  return unix_s < 0 ? std::nullopt : std::optional(unix_s);
}

ErrorCode code_of(wire::ResultCode code) {
  switch (code) {
    case wire::RESULT_UNSUPPORTED:
    case wire::RESULT_INVALID_ARGUMENT:
    case wire::RESULT_UNKNOWN_OPERATION:
      return ErrorCode::kUsage;
    case wire::RESULT_REFUSED:
    case wire::RESULT_WRONG_CONTRACT:
    case wire::RESULT_WRONG_IDENTITY:
    case wire::RESULT_MALFORMED:
      return ErrorCode::kRefused;
    case wire::RESULT_NOT_FOUND:
      return ErrorCode::kNotFound;
    case wire::RESULT_CONFLICT:
      return ErrorCode::kConflict;
    case wire::RESULT_TOO_LARGE:
      return ErrorCode::kTooLarge;
    case wire::RESULT_OUT_OF_RESOURCES:
    case wire::RESULT_BUSY:
    case wire::RESULT_DEADLINE_MISSED:
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

Note note_of(const wire::Note& note) {
  constexpr Note::Severity kSeverities[] = {Note::Severity::kInfo, Note::Severity::kWarning,
                                            Note::Severity::kStop};
  return {note.code().to_string(), kSeverities[note.severity()], note.text()};
}

exchange::ModelInfo from_wire(const wire::ModelInfo& info) {
  exchange::ModelInfo result;
  result.cell = info.cell();
  result.id = info.id();
  result.hash = info.hash();
  result.level = info.level();
  result.batch_id = info.batch_id();
  result.version = info.version();
  result.trained_at_unix_s = info.trained_at_unix_s();
  result.batch_hash = info.batch_hash();
  result.training_age_s = info.training_age_s();
  result.measured_at_unix_s = if_known(info.measured_at_unix_s());
  result.data_age_s = if_known(info.data_age_s());
  result.training_poses = info.training_poses();
  result.validation_rms_mm = if_known(info.validation_rms_mm());
  result.in_force = info.in_force();
  for (const wire::Note& note : info.notes()) result.notes.push_back(note_of(note));
  for (const std::string& line : info.budget()) result.budget.push_back(line);
  return result;
}

JobStatus status_of(const wire::Job& job) {
  JobStatus status{job.number(), job.cell(),          text(job.stage()), job.what(),
                   job.share(),  job.model_version(), job.in_force()};
  const wire::JobOutcome& outcome = job.outcome();
  status.verdict = text(outcome.verdict());
  status.held_back = text(outcome.held_back());
  status.before_mm = if_known(outcome.before_mm());
  status.after_mm = if_known(outcome.after_mm());
  status.limit_mm = if_known(outcome.limit_mm());
  status.u95_mm = if_known(outcome.u95_mm());
  status.why = outcome.why();
  status.next = outcome.next();
  return status;
}

DatedJob from_wire(const wire::Job& job, const std::string& server) {
  DatedJob dated;
  dated.status = status_of(job);
  dated.server = server;
  dated.kind = text(job.kind());
  dated.worker = job.server();
  dated.batches = job.batch_ids();
  dated.created_unix_s = job.created_unix_s();
  dated.started_unix_s = if_known(job.started_unix_s());
  dated.finished_unix_s = if_known(job.finished_unix_s());
  return dated;
}

BatchOfService from_wire(const wire::BatchInfo& batch) {
  return {
      batch.cell(), batch.id(),     batch.quarantine(), batch.poses(), batch.accepted_at_unix_s(),
      batch.hash(), batch.learned()};
}

ServerStatus from_wire(const wire::ServiceStatus& status) {
  ServerStatus result;
  result.server_id = status.server().to_string();
  result.version = status.program_version();
  result.state = status.state() == wire::SERVICE_SERVING ? "serving" : "stopping";
  result.cells = status.cells();
  result.requests = status.requests();
  result.refused = status.refused();
  result.shed = status.shed();
  result.unheard = status.unheard();
  result.misdirected = status.misdirected();
  result.unreadable = status.unreadable();
  result.lost = status.lost();
  result.trouble = status.trouble();
  result.uptime_s = status.uptime_s();
  result.queued_jobs = status.queued_jobs();
  return result;
}

namespace {

Error error_of(const wire::Problem& problem) {
  Error error;
  error.code = code_of(problem.code());
  error.message = problem.what();
  error.file = problem.file();
  if (problem.row() > 0) error.row = static_cast<long>(problem.row());
  error.field = problem.field();
  if (problem.has_value()) error.value = problem.value();
  if (problem.has_limit()) error.limit = problem.limit();
  error.text = problem.text();
  error.next = problem.next();
  return error;
}

}  // namespace

Error error_of(const wire::ReplyHeader& header) {
  std::vector<Error> problems;
  for (const wire::Problem& problem : header.problems()) problems.push_back(error_of(problem));
  if (problems.empty()) return failure(code_of(header.result()), "{}", header.message()).value();
  problems.front().code = code_of(header.result());
  return together(std::move(problems));
}

}  // namespace trammel::client
