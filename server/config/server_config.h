#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/dds/dds_options.h"
#include "server/host/log_options.h"
#include "server/http/http_options.h"
#include "server/robot/cell.h"
#include "server/trainer/trainer.h"

namespace trammel {

constexpr std::size_t kMaxCells = 1024;  // of one server, by the wire

/// The configuration of a server.
struct ServerConfig {
  std::map<std::string, std::shared_ptr<const Cell>> cells;  ///< by name
  std::string store;  ///< path of the file, or URL of a PostgreSQL
  std::string cache;  ///< folder of the models last in force, where the store is a PostgreSQL
  std::size_t models_in_memory = std::size_t{8192} << 20;  ///< bytes; beyond, the least recently
                                                           ///< used models leave the memory
  bool serves = true;  ///< false: it works on jobs of a shared store only
  DdsOptions dds;
  TrainerOptions trainer;
  LogOptions log;
  HttpOptions http;
};

/// Reads a server file (`config/server.yaml` has every key) and the cell files that it names. Paths
/// in it are relative to it. Reports all errors at once, one line each with file, key and limit.
/// Refuses an unknown, repeated or missing key, a wrong type, a value out of range, two cells with
/// one name, an address that leaves this host without `allow_network`, and a bias or an error
/// source that the first training would refuse.
[[nodiscard]] Result<ServerConfig> read_server_config(const std::string& path);

/// The part of a server file that could be read, and all errors in the rest.
struct ServerReading {
  ServerConfig config;
  std::vector<Error> problems;  ///< each by itself
};
[[nodiscard]] ServerReading read_server(const std::string& path);

}  // namespace trammel
