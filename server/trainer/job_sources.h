#pragma once

#include <set>
#include <string>
#include <vector>

#include "server/store/store.h"

namespace trammel {

/// Refuses a batch in quarantine: no model learns from it.
[[nodiscard]] Status check_released(const StoredBatch& batch);

/// A stored batch that a job needs.
struct BatchSource {
  std::string id;
  bool judges = false;
};

/// The earlier sessions that a training of these batches learns from as well, by the cell's rule,
/// oldest first, from Store::batches_learned_from(). It takes the newest sessions that have,
/// together with the job's own, at most `max_poses` poses.
[[nodiscard]] Result<std::vector<std::string>> earlier_sessions(const Store& store,
                                                                const StoredJob& job,
                                                                const SessionRule& rule,
                                                                int max_poses);

/// The newest 50 batches of the cell whose rows may judge a model, oldest first: those that later
/// trainings may learn from, and `also`. Batches that are in quarantine or pruned are left out.
[[nodiscard]] Result<std::vector<BatchSource>> judging_sources(const Store& store,
                                                               const std::string& cell,
                                                               const std::set<std::string>& also);

/// The stored batches for the job: its own, `earlier` ones and, if it may make a model (`judged`),
/// those whose rows may judge the model. These are judging_sources() and its own, even if they are
/// in quarantine. Refuses a training from quarantined batches that it may not release.
[[nodiscard]] Result<std::vector<BatchSource>> batch_sources(
    const Store& store, const StoredJob& job, bool judged,
    const std::vector<std::string>& earlier = {});

}  // namespace trammel
