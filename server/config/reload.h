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

/// Plans the changes that a running server takes on: added cells; level and format of the log; the
/// queue limits of `dds` (client_requests, client_mb, queued_requests, queued_mb, cell_share);
/// queue_capacity, keep_models, keep_batches and keep_answers of `trainer`. A removed cell, or one
/// with a changed cell or robot file, takes effect at the next start. Values that the command line
/// overrides must be overridden in both.
[[nodiscard]] ReloadPlan plan_reload(const ServerConfig& present, const ServerConfig& file);

}  // namespace trammel
