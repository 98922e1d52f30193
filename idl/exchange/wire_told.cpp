#include "idl/exchange/wire_told.h"

#include <cmath>

namespace trammel::wire {
namespace {

const char* text(JobStage stage) {
  switch (stage) {
    case JOB_QUEUED:
      return "queued";
    case JOB_TRAINING:
      return "training";
    case JOB_STORING:
      return "storing";
    case JOB_DONE:
      return "done";
    case JOB_FAILED:
      return "failed";
    case JOB_CANCELLED:
      return "cancelled";
  }
  return "failed";
}

const char* text(JobVerdict verdict) {
  switch (verdict) {
    case VERDICT_OPEN:
      return "open";
    case VERDICT_IN_FORCE:
      return "in_force";
    case VERDICT_NOT_BETTER:
      return "not_better";
    case VERDICT_UNDECIDED:
      return "undecided";
    case VERDICT_DIAGNOSED:
      return "diagnosed";
    case VERDICT_NOTHING_APPLIED:
      return "nothing_applied";
    case VERDICT_QUARANTINED:
      return "quarantined";
    case VERDICT_REFUSED:
      return "refused";
    case VERDICT_OVER_LIMIT:
      return "over_limit";
    case VERDICT_BROKEN:
      return "broken";
    case VERDICT_CANCELLED:
      return "cancelled";
  }
  return "open";
}

const char* text(HeldBack reason) {
  switch (reason) {
    case HELD_BACK_NO:
      return "";
    case HELD_BACK_FEW_JUDGES:
      return "few_judges";
    case HELD_BACK_STOP_NOTE:
      return "stop_note";
    case HELD_BACK_STEP_LIMIT:
      return "step_limit";
  }
  return "";
}

const char* text(JobKind kind) {
  switch (kind) {
    case JOB_TRAINING_OF_BATCHES:
      return "train";
    case JOB_DIAGNOSIS:
      return "diagnose";
    case JOB_CHECK:
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

ErrorCode code_of(ResultCode code) {
  switch (code) {
    case RESULT_UNSUPPORTED:
    case RESULT_INVALID_ARGUMENT:
    case RESULT_UNKNOWN_OPERATION:
      return ErrorCode::kUsage;
    case RESULT_REFUSED:
    case RESULT_WRONG_CONTRACT:
    case RESULT_WRONG_IDENTITY:
    case RESULT_MALFORMED:
      return ErrorCode::kRefused;
    case RESULT_NOT_FOUND:
      return ErrorCode::kNotFound;
    case RESULT_CONFLICT:
      return ErrorCode::kConflict;
    case RESULT_TOO_LARGE:
      return ErrorCode::kTooLarge;
    case RESULT_OUT_OF_RESOURCES:
    case RESULT_BUSY:
    case RESULT_DEADLINE_MISSED:
      return ErrorCode::kBusy;
    case RESULT_OK:
    case RESULT_UNKNOWN_EXCEPTION:
    case RESULT_INTERNAL:
      return ErrorCode::kInternal;
  }
  return ErrorCode::kInternal;
}

trammel::Note note_of(const Note& note) {
  using Severity = trammel::Note::Severity;
  constexpr Severity kSeverities[] = {Severity::kInfo, Severity::kWarning, Severity::kStop};
  return {note.code().to_string(), kSeverities[note.severity()], note.text()};
}

}  // namespace

exchange::ModelInfo from_wire(const ModelInfo& info) {
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
  for (const Note& note : info.notes()) result.notes.push_back(note_of(note));
  for (const std::string& line : info.budget()) result.budget.push_back(line);
  return result;
}

exchange::JobStatus status_of(const Job& job) {
  exchange::JobStatus status{job.number(), job.cell(),          text(job.stage()), job.what(),
                             job.share(),  job.model_version(), job.in_force()};
  const JobOutcome& outcome = job.outcome();
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

exchange::DatedJob from_wire(const Job& job, const std::string& server) {
  exchange::DatedJob dated;
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

exchange::BatchOfService from_wire(const BatchInfo& batch) {
  return {
      batch.cell(), batch.id(),     batch.quarantine(), batch.poses(), batch.accepted_at_unix_s(),
      batch.hash(), batch.learned()};
}

namespace {

Error error_of(const Problem& problem) {
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

Error error_of(const ReplyHeader& header) {
  std::vector<Error> problems;
  for (const Problem& problem : header.problems()) problems.push_back(error_of(problem));
  if (problems.empty()) return failure(code_of(header.result()), "{}", header.message()).value();
  problems.front().code = code_of(header.result());
  return together(std::move(problems));
}

}  // namespace trammel::wire
