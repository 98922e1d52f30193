#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// Jobs and batches of a service, for people and programs.
namespace trammel::exchange {

/// A job as it goes on, and its outcome.
struct JobStatus {
  std::int64_t job = 0;
  std::string cell, stage, what;  ///< stage: `queued training storing done failed`
  double share = 0;
  int model_version = 0;
  bool in_force = false;
  /// The outcome: `open in_force not_better undecided diagnosed nothing_applied quarantined refused
  /// over_limit broken cancelled`.
  std::string verdict = "open";
  /// The held-out rms of the model in force before and of the new model; the limit for the new one;
  /// two standard uncertainties of the difference. Empty: not judged.
  std::optional<double> before_mm = {}, after_mm = {}, limit_mm = {}, u95_mm = {};
  std::string why = {};   ///< for a job that made no model
  std::string next = {};  ///< the next step for the user, as one clause
  /// Why a person decides about its model: `few_judges stop_note step_limit`; empty: the poses held
  /// out decide. After the last two no later training learns from its batch until a model that did
  /// has been in force.
  std::string held_back = {};
};

/// A job with its request and its times; times are Unix time, s, empty: not yet, or not recorded.
struct DatedJob {
  JobStatus status;
  std::string server, kind;  ///< server: the one that listed it; kind: `train diagnose check`
  std::string worker;  ///< the server that works on it, or did; empty: none yet, or not recorded
  std::vector<std::string> batches;
  std::int64_t created_unix_s = 0;
  std::optional<std::int64_t> started_unix_s, finished_unix_s;
};

/// A batch that a service has.
struct BatchOfService {
  std::string cell, batch;
  std::string reason;  ///< why it is kept out; empty: it is not
  int poses = 0;
  std::int64_t accepted_unix_s = 0;
  std::string hash;         ///< SHA-256 of its text
  bool learned = false;     ///< later trainings may learn from it: it gave a model that is not held
                            ///< back as doubtful
  std::string server = {};  ///< the server that states this
};

}  // namespace trammel::exchange
