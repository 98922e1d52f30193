#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/exchange/answer.h"

/// The arguments and results of a session. Questions to a model and its answers: server/exchange.
namespace trammel::client {

/// The subject of a call, which must match the training of the model.
struct CallContext {
  std::string cell;
  std::string tool;     ///< empty: the cell's only one
  std::string payload;  ///< empty: the cell's only one
  bool controller_compensates = false;
  std::string model;  ///< empty: the model in force; else `@version` or a model id, which must be
                      ///< the one in force
  exchange::Rails rails = {};  ///< the robot's joints that are rails; empty: none
};

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

/// The assumptions of a change.
struct ChangeOptions {
  std::optional<int> expected_version =
      {};  ///< the version that must be in force, 0: none; otherwise nothing changes (kConflict)
  std::string id =
      {};  ///< unique for ever: the change happens once under it; empty: the session makes one
  bool force = false;  ///< for an activation: accept a version that is worse than the one in force
  std::string reason =
      {};  ///< for the audit trail, for changes of the version in force and of quarantine
};

/// The audit trail of a server as it sends it: JSON.
struct AuditText {
  std::string server, json;
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
  bool learned = false;     ///< later trainings may learn from it: it gave a model that is not held
                            ///< back as doubtful
  std::string server = {};  ///< the server that states this
};

struct ServerStatus {
  std::string server_id, version, state;
  std::vector<std::string> cells;
  std::uint64_t requests = 0, refused = 0;  ///< answered requests, and those of them answered with
                                            ///< an error
  std::uint64_t shed = 0,
                unheard = 0;  ///< those of them refused as busy or too late; replies without a
                              ///< reader, since the client had left
  std::uint64_t misdirected = 0,
                unreadable = 0;  ///< dropped: to another client's partition; not even a header
  std::uint64_t lost = 0;        ///< by DDS
  std::string trouble;           ///< its present trouble and the reason; empty: none
  double uptime_s = 0;
  int queued_jobs = 0;
};

}  // namespace trammel::client
