#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/result.h"
#include "server/compensate/held_back.h"

namespace trammel {

/// The outcome of a job.
enum class JobVerdict {
  kOpen,       ///< nothing yet; also of jobs from before outcomes were recorded
  kInForce,    ///< its model was put in force
  kNotBetter,  ///< its model is stored; the one in force stays, because the new one is not better
  kUndecided,  ///< its model is stored; a person decides, see JobOutcome::held_back
  kDiagnosed,  ///< the diagnosis is made; nothing was to be applied
  kNothingApplied,  ///< the diagnosis is made; it found nothing to extend a model with
  kQuarantined,     ///< its batch is in quarantine; no model learned from it
  kRefused,         ///< the data or the request cannot be trained from
  kOverLimit,       ///< over the memory or the processor time that a job may take
  kBroken,    ///< its computing crashed or hung, as often as it may be tried, or the service failed
  kCancelled  ///< on request
};
/// The spelling for programs: `in_force`, `not_better`.
[[nodiscard]] const char* to_text(JobVerdict verdict);
/// Empty where there is no such verdict.
[[nodiscard]] std::optional<JobVerdict> job_verdict_of(std::string_view text);

/// The reverse of to_text(ErrorCode); empty where there is no such code.
[[nodiscard]] std::optional<ErrorCode> error_code_of(std::string_view text);

/// The end of a job as data. Its message (StoredJob) is the same in one sentence.
struct JobOutcome {
  JobVerdict verdict = JobVerdict::kOpen;
  HeldBack held_back = HeldBack::kNo;  ///< of a job that made a model, even one that is not better
  std::optional<double> before;   ///< m, held-out rms of the model in force; for a first model, of
                                  ///< the nominal one
  std::optional<double> after;    ///< m, of the new model on the same poses
  std::optional<double> limit;    ///< m, the value below which `after` had to be
  std::optional<ErrorCode> code;  ///< of a job that failed
  std::string why;                ///< for people, one clause
  std::string next;               ///< the next step for the user; empty: none
  std::optional<std::int64_t> peak_memory;  ///< bytes, of the process that computed it
  std::optional<double> processor_time;     ///< s, likewise
};

}  // namespace trammel
