#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/exchange/answer.h"

/// The arguments and results of a session. What it is asked and what a model answers:
/// server/exchange.
namespace trammel::client {

/// The subject of a call; must fit what the model was trained on.
struct CallContext {
  std::string cell;
  std::string tool;     ///< empty: the cell's only one
  std::string payload;  ///< empty: the cell's only one
  bool controller_compensates = false;
  std::string model;  ///< empty: the model in force; else `@version` or a model id that must be the
                      ///< one in force
  exchange::Rails rails = {};  ///< the robot's joints that are rails; empty: none
};

struct JobStatus {
  std::int64_t job = 0;
  std::string cell, stage, what;  ///< stage: `queued training storing done failed`
  double share = 0;
  int model_version = 0;
  bool in_force = false;
  /// The way in which it ended: `open in_force not_better undecided diagnosed nothing_applied
  /// quarantined refused over_limit broken cancelled`.
  std::string verdict = "open";
  /// Held-out rms of what was in force, and of the new model; what that must not exceed; two
  /// standard uncertainties of the difference. Empty: not judged.
  std::optional<double> before_mm = {}, after_mm = {}, limit_mm = {}, u95_mm = {};
  std::string why = {};   ///< of a job that made no model
  std::string next = {};  ///< what to do, as one clause
  /// Why a person decides about its model: `few_judges stop_note step_limit`; empty: the poses held
  /// out decide. After the last two no later training learns from its batch until a model that did
  /// has been in force.
  std::string held_back = {};
};

/// The assumptions of a change.
struct ChangeOptions {
  std::optional<int> expected_version =
      {};  ///< in force, 0: none; with another one nothing changes (kConflict)
  std::string id =
      {};  ///< unique for ever: the change happens once under it; empty: the session makes one
  bool force = false;  ///< of an activation: also of a version that is worse than the one in force
  std::string reason =
      {};  ///< for the audit trail, of changes of what is in force and of quarantine
};

/// The audit trail of a server as it sends it: JSON.
struct AuditText {
  std::string server, json;
};

/// A job with what was asked for and when; times are Unix time, s, empty: not yet, or not recorded.
struct DatedJob {
  JobStatus status;
  std::string server, kind;  ///< server: that told of it; kind: `train diagnose check`
  std::string worker;        ///< server that works on it, or did; empty: none yet, or not recorded
  std::vector<std::string> batches;
  std::int64_t created_unix_s = 0;
  std::optional<std::int64_t> started_unix_s, finished_unix_s;
};

/// The result of a diagnosis.
struct DiagnosisAnswer {
  std::string findings_json;     ///< as `trammel diagnose --json` prints them
  std::string page_html;         ///< self-contained; empty if not asked for, or no longer kept
  exchange::ModelInfo in_force;  ///< now; empty id: none
};

/// A batch that a service has.
struct BatchOfService {
  std::string cell, batch;
  std::string reason;  ///< why it is kept out; empty: it is not
  int poses = 0;
  std::int64_t accepted_unix_s = 0;
  std::string hash;         ///< SHA-256 of its text
  bool learned = false;     ///< later trainings may learn from it: a model of it was made, and is
                            ///< not held back as doubtful
  std::string server = {};  ///< that says so
};

struct ServerStatus {
  std::string server_id, version, state;
  std::vector<std::string> cells;
  std::uint64_t requests = 0, refused = 0;  ///< answered; of them with an error
  std::uint64_t shed = 0,
                unheard = 0;  ///< of them: busy or too late; to nobody, the client had left
  std::uint64_t misdirected = 0,
                unreadable = 0;  ///< dropped: to another client's partition; not even a header
  std::uint64_t lost = 0;        ///< by DDS
  std::string trouble;           ///< what it cannot do now, and why; empty: nothing
  double uptime_s = 0;
  int queued_jobs = 0;
};

}  // namespace trammel::client
