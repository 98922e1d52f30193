#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/http/watched.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// The parts of a server of small cells, without DDS. May be taken down and set up again on the
/// same store.
class WatchedServer {
 public:
  /// `place`: of the store; empty: a file.
  explicit WatchedServer(ServedCells cells = {{"cell-7", small_cell("cell-7")}},
                         const std::string& place = "")
      : place_(place.empty() ? store_path() : place), cells_(std::move(cells)) {
    set_up();
  }

  void take_down() {
    trainer_.reset();
    registry_.reset();
    store_.reset();
  }
  void set_up(std::size_t budget = ModelRegistry::kNoLimit) {
    store_ = demand(Store::open(place_));
    store_->works_as("server-a");
    registry_ = std::make_unique<ModelRegistry>(budget);
    trainer_ = std::make_unique<Trainer>(cells_, *store_, *registry_, TrainerOptions());
    trainer_->set_listeners(
        [this](const JobProgress&) {
          const std::lock_guard lock(mutex_);
          changed_.notify_all();
        },
        [](const ServedModel&, bool) {});
  }
  void set_cells(ServedCells cells) { cells_ = std::move(cells); }

  /// A batch that is learned from at once.
  std::int64_t submit(const std::string& cell, const std::string& batch, std::uint64_t seed) {
    SmallBatch measured;
    measured.seed = seed;
    return demand(
        trainer_->submit(cell, batch, small_batch_csv(*cells_.at(cell), measured), batch));
  }
  /// Until all jobs are over.
  void work() {
    static_cast<void>(demand(trainer_->start()));
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return trainer_->unfinished_jobs().empty(); });
    lock.unlock();
    trainer_->stop();
  }

  [[nodiscard]] Watched watched() {
    return {"server-a",
            "0.1.0",
            store_path(),
            *trainer_,
            *store_,
            *registry_,
            [this] { return figures; },
            [this] { return movement; }};
  }
  [[nodiscard]] std::string store_path() const { return folder_.file("trammel.db"); }
  [[nodiscard]] Trainer& trainer() { return *trainer_; }
  [[nodiscard]] Store& store() { return *store_; }
  [[nodiscard]] ModelRegistry& registry() { return *registry_; }
  [[nodiscard]] const TemporaryFolder& folder() const { return folder_; }

  ServiceFigures figures;
  Movement movement{true, {}};

 private:
  TemporaryFolder folder_;
  std::string place_;
  ServedCells cells_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<ModelRegistry> registry_;
  std::unique_ptr<Trainer> trainer_;
};

}  // namespace trammel::test
