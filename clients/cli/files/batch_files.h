#pragma once

#include <string>
#include <vector>

#include "server/measurement/checked_batch.h"
#include "server/measurement/files/joint_list.h"

namespace trammel::cli {

/// read_batch() and read_joint_csv() with a warning on standard error about column names similar to
/// known ones. Refuses a model file as such.
[[nodiscard]] Result<MeasurementBatch> read_batch_file(const std::string& path);
[[nodiscard]] Result<JointList> read_joint_file(const std::string& path);

/// The batches of a cell, joined. Each batch is one session, or its column divides it into
/// sessions.
[[nodiscard]] Result<CheckedBatch> read_checked_batches(const std::vector<std::string>& paths,
                                                        const Cell& cell,
                                                        const HoldOut& hold_out = drawn(0, 0));

}  // namespace trammel::cli
