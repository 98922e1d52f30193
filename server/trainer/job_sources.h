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

/// The stored batches that the job is computed from: those it works on and, where it may make a model (`judged`), the
/// newest 50 whose rows may judge that one, oldest first: not in quarantine, not waiting, nothing that failed. Refuses
/// a training from batches in quarantine that it may not release.
[[nodiscard]] Result<std::vector<BatchSource>> batch_sources(const Store& store, const StoredJob& job, bool judged);

}  // namespace trammel
