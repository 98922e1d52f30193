#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/robot/cell_description.h"

/// The servers of a record, and the work of each.
namespace trammel {

/// The period of a server's heartbeat. A server without one for three periods is gone.
constexpr std::chrono::seconds kHeartbeat{5};
constexpr std::chrono::seconds kGoneAfter = 3 * kHeartbeat;

/// A server's state of one cell.
struct CellAtServer {
  int version = 0;  ///< the version that it serves; 0: none
  CellDescription files;
  std::string why_not = {};  ///< why it does not answer for the cell, or how its files differ from
                             ///< the record; one sentence; empty: it answers, or has no model
  bool is_apart = false;  ///< it does not answer, since the record used other files when it began,
                          ///< and still does
  bool operator==(const CellAtServer&) const = default;
};

/// A server's description of itself.
struct ServerSelf {
  std::string server;  ///< its name
  std::string host;
  std::int64_t pid = 0;
  std::string program;  ///< its version
  bool serves = true, trains = true;
  std::map<std::string, CellAtServer> cells = {};
  std::int64_t followed = 0;  ///< the number of changes of the record that it has taken up

  /// The description of this process.
  [[nodiscard]] static ServerSelf here(std::string program, bool serves, bool trains);
};

/// A job that a server works on.
struct JobAtServer {
  std::int64_t job = 0;
  std::string cell;
  bool operator==(const JobAtServer&) const = default;
};

/// A server as the record knows it. Times are Unix time in s, by the record's clock.
struct ServerInRecord {
  ServerSelf self;
  std::int64_t since = 0;     ///< when it began
  std::int64_t heard_at = 0;  ///< when it was heard of last
  std::int64_t silent_s = 0;  ///< the time since its last heartbeat
  bool is_gone = false;       ///< three heartbeats are missing
  std::int64_t behind = 0;    ///< the number of changes that it has not taken up
  std::vector<JobAtServer> works_on = {};
};

}  // namespace trammel
