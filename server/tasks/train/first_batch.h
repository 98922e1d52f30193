#pragma once

#include <memory>
#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/checked_batch.h"
#include "server/robot/cell.h"

namespace trammel {

/// The reason against learning from a batch that no model in force can judge: it was misread
/// (batch_doubt()), or something changed in the middle of it (jump_within(); `text` is the pose,
/// `row` its row). The command line, the library, Python and the daemon call this before a model is
/// trained from nothing, unless a person has looked at the batch. `batch` is checked against
/// `cell`; `level` replaces the cell's error sources.
[[nodiscard]] std::optional<Error> doubt_of_first_batch(
    const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
    const std::optional<std::string>& level = {});
/// Refuses a batch with a doubt_of_first_batch().
[[nodiscard]] Status check_first_batch(const std::shared_ptr<const Cell>& cell,
                                       const CheckedBatch& batch,
                                       const std::optional<std::string>& level = {});

}  // namespace trammel
