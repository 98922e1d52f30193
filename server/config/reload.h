#pragma once

#include <string>
#include <vector>

#include "server/config/server_config.h"

namespace trammel {

/// The plan for a server file that is read again while it is served.
struct ReloadPlan {
  ServerConfig config;             ///< from now on
  std::vector<std::string> now;    ///< keys that have changed
  std::vector<std::string> later;  ///< keys that differ and change with the next start
};

/// Takes on: cells that are added (one that is left out, or whose file or robot file has changed:
/// with the next start); level and format of the log; of `dds` how much may wait (client_requests,
/// client_mb, queued_requests, queued_mb, cell_share); of `trainer` queue_capacity and keep_models,
/// keep_batches, keep_answers. What the command line says instead of the file is to stand in both.
[[nodiscard]] ReloadPlan plan_reload(const ServerConfig& present, const ServerConfig& file);

}  // namespace trammel
