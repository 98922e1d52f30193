#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/exchange/answer.h"
#include "server/exchange/history.h"

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

using exchange::BatchOfService;
using exchange::DatedJob;
using exchange::JobStatus;

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

/// The result of a diagnosis.
struct DiagnosisAnswer {
  std::string findings_json;     ///< as `trammel diagnose --json` prints them
  std::string page_html;         ///< self-contained; empty if not asked for, or no longer kept
  exchange::ModelInfo in_force;  ///< now; empty id: none
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
