#pragma once

#include "server/http/page_shell.h"
#include "server/http/watched.h"

namespace trammel {

/// The servers of the record, the cells that they serve, and the unfinished jobs: one page, the
/// same on every server.
[[nodiscard]] ServicePage servers_page(const Watched& server);

}  // namespace trammel
