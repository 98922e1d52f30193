#pragma once

#include <string>
#include <vector>

#include "server/store/store.h"

namespace trammel {

/// Refused while the batch is in quarantine: nothing is learned from it.
[[nodiscard]] Status check_released(const StoredBatch& batch);

/// A stored batch that a job needs.
struct BatchSource {
  std::string id;
  bool judges = false;
};

/// The sessions that a training of these batches learns from beside them, by the cell's rule,
/// oldest first: those that a model was made from before. As many of the newest as have `max_poses`
/// poses together with the job's own.
[[nodiscard]] Result<std::vector<std::string>> earlier_sessions(const Store& store,
                                                                const StoredJob& job,
                                                                const SessionRule& rule,
                                                                int max_poses);

/// The stored batches that the job is computed from: those it works on, `earlier` ones and, where
/// it may make a model
/// (`judged`), the newest 50 whose rows may judge that one, oldest first: not in quarantine, not
/// waiting, nothing that failed. Refuses a training from batches in quarantine that it may not
/// release.
[[nodiscard]] Result<std::vector<BatchSource>> batch_sources(
    const Store& store, const StoredJob& job, bool judged,
    const std::vector<std::string>& earlier = {});

}  // namespace trammel
