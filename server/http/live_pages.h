#pragma once

#include <cstdint>
#include <string>

#include "server/base/result.h"
#include "server/http/page_shell.h"
#include "server/http/watched.h"

namespace trammel {

/// All cells: whether each is answered for, its model, and the model's age.
[[nodiscard]] ServicePage fleet_page(const Watched& server);
/// One cell: its model in force, its versions, jobs, quarantined batches, and changes.
[[nodiscard]] Result<ServicePage> cell_page(const Watched& server, const std::string& cell);
/// The waiting and running jobs, and the last ended ones.
[[nodiscard]] Result<ServicePage> jobs_page(const Watched& server);
[[nodiscard]] Result<ServicePage> job_page(const Watched& server, std::int64_t job);

/// The report of a model; `version` need not be in memory.
[[nodiscard]] Result<std::string> model_report(const Watched& server, const std::string& cell,
                                               int version);
/// The history of the cell, over its last versions.
[[nodiscard]] Result<std::string> history_report(const Watched& server, const std::string& cell);

}  // namespace trammel
