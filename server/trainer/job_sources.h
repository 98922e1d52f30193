#pragma once

#include <set>
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
/// oldest first: of Store::batches_learned_from(). As many of the newest as have `max_poses`
/// poses together with the job's own.
[[nodiscard]] Result<std::vector<std::string>> earlier_sessions(const Store& store,
                                                                const StoredJob& job,
                                                                const SessionRule& rule,
                                                                int max_poses);

/// The newest 50 batches of the cell whose rows may judge a model, oldest first: those that later
/// trainings may learn from, and `also`; none that is in quarantine or pruned.
[[nodiscard]] Result<std::vector<BatchSource>> judging_sources(const Store& store,
                                                               const std::string& cell,
                                                               const std::set<std::string>& also);

/// The stored batches that the job is computed from: those it works on, `earlier` ones and, where
/// it may make a model (`judged`), those whose rows may judge that one: judging_sources(), and its
/// own also where they are in quarantine. Refuses a training from batches in quarantine that it may
/// not release.
[[nodiscard]] Result<std::vector<BatchSource>> batch_sources(
    const Store& store, const StoredJob& job, bool judged,
    const std::vector<std::string>& earlier = {});

}  // namespace trammel
