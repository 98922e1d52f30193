#pragma once

#include <atomic>
#include <memory>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/trainer/served_cells.h"

namespace trammel {

/// Which cells are served. Cells are added while requests and jobs are under way; none leaves. Thread-safe; whoever
/// reads waits for nobody.
class CellBook {
 public:
  explicit CellBook(ServedCells cells) { keep(std::move(cells)); }

  /// Stays as it is as long as the book is there; the next call may give more cells.
  [[nodiscard]] const ServedCells& now() const { return *now_.load(); }

  /// A cell that is there already stays as it was.
  void add(const ServedCells& more) {
    const MutexLock lock(mutex_);
    ServedCells all = now();
    all.insert(more.begin(), more.end());
    keep(std::move(all));
  }

 private:
  void keep(ServedCells cells) {
    kept_.push_back(std::make_unique<const ServedCells>(std::move(cells)));
    now_ = kept_.back().get();
  }

  Mutex mutex_;                                           // one at a time adds
  std::vector<std::unique_ptr<const ServedCells>> kept_;  // somebody may read one: pointers to cells, one map an add()
  std::atomic<const ServedCells*> now_ = nullptr;
};

}  // namespace trammel
