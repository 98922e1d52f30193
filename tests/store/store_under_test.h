#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/base/hash.h"
#include "server/store/store.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

/// What the tests of the store share.
namespace trammel::test {

inline StoredBatch batch_of(const std::string& id, const std::string& csv,
                            const std::string& request) {
  return {"cell-7", id, csv, sha256_hex(csv), request, 1700000000, 1};
}
/// With a content and a request of its own.
inline StoredBatch batch_of(const std::string& id) {
  return batch_of(id, "q1_deg\n" + id + "\n", "client:" + id);
}

/// A training from that batch.
inline StoredJob job_of(const std::string& batch) {
  StoredJob job;
  job.cell = "cell-7";
  job.batch_ids = {batch};
  return job;
}

/// A store, and what the tests do with it.
class StoreUnderTest {
 protected:
  /// `place`: empty: a file.
  explicit StoreUnderTest(const std::string& place = {})
      : path_(place.empty() ? folder_.file("trammel.db") : place) {}

  void open() { store_ = demand(Store::open(path_, folder_.file("cache"))); }
  void restart() {
    store_.reset();
    open();
  }
  /// The job that came with it.
  std::int64_t submit(const StoredBatch& batch) {
    return demand(store_->add_batch(batch, job_of(batch.id))).id;
  }
  /// Its version. `poses`: that it was trained from, which tells models apart.
  int add_model(int poses, bool put_in_force = false, std::int64_t job = 0) {
    return demand(
        store_->add_model("cell-7", nominal_model(cell_, poses), job, put_in_force, "made"));
  }
  int in_force() { return demand(store_->version_in_force("cell-7")).value_or(0); }

  TemporaryFolder folder_;
  const std::string path_;
  const std::shared_ptr<const Cell> cell_ = small_cell("cell-7");
  std::unique_ptr<Store> store_;
};

}  // namespace trammel::test
