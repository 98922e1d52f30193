#pragma once

#include <cstdint>
#include <string>

#include "server/base/result.h"
#include "server/http/page_shell.h"
#include "server/http/watched.h"

namespace trammel {

/// All cells: whether each is answered for, with which model, how old that is.
[[nodiscard]] ServicePage fleet_page(const Watched& server);
/// One cell: its model in force, its versions, jobs, batches that are kept out, what was changed.
[[nodiscard]] Result<ServicePage> cell_page(const Watched& server, const std::string& cell);
/// The jobs that wait or run, and the last ones that ended.
[[nodiscard]] Result<ServicePage> jobs_page(const Watched& server);
[[nodiscard]] Result<ServicePage> job_page(const Watched& server, std::int64_t job);

/// The report of a model; `version` need not be in memory.
[[nodiscard]] Result<std::string> model_report(const Watched& server, const std::string& cell,
                                               int version);
/// The history of the cell, over its last versions.
[[nodiscard]] Result<std::string> history_report(const Watched& server, const std::string& cell);

}  // namespace trammel
