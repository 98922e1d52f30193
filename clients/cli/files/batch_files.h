#pragma once

#include <string>
#include <vector>

#include "server/measurement/checked_batch.h"

namespace trammel::cli {

/// The batches of a cell, joined: each is a session of its own, or as many as its column says.
[[nodiscard]] Result<CheckedBatch> read_checked_batches(const std::vector<std::string>& paths, const Cell& cell,
                                                        const HoldOut& hold_out = drawn(0, 0));

}  // namespace trammel::cli
