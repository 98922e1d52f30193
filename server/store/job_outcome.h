#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"

namespace trammel {

enum class JobVerdict {
  kNone,         ///< the job is not over, or nobody recorded it
  kInForce,      ///< its model was put in force
  kNotInForce,   ///< its model was judged and is kept, not in force
  kUndecided,    ///< its model is kept, not in force: too little to judge it by; a person decides
  kNoModel,      ///< a diagnosis, or nothing to apply
  kQuarantined,  ///< its batch is kept out
  kFailed,
  kCancelled
};

/// How a job ended, as data. Figures are rms over the poses held out, m; empty: not judged.
struct JobOutcome {
  JobVerdict verdict = JobVerdict::kNone;
  int judged_on = 0;                  ///< poses
  std::optional<double> before = {};  ///< of what was in force; of the nominal model where nothing was
  std::optional<double> after = {};   ///< of the new model
  std::optional<double> limit = {};   ///< that `after` must not exceed
  std::optional<double> u95 = {};     ///< of the difference, two standard uncertainties
  std::optional<Error> why = {};      ///< of a job that made no model: what is wrong
  std::string next = {};              ///< what to do, as one clause
};

}  // namespace trammel
