#pragma once

#include <algorithm>
#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/trainer/served_cells.h"

namespace trammel {

/// A cell with files that the record does not use.
struct ApartCell {
  std::string why;
  bool answers =
      false;  ///< the record did when this server began: it goes on with the model that it has
  bool operator==(const ApartCell&) const = default;
};

/// The served cells. Cells are added while requests and jobs are under way; none is removed. Some
/// may be set apart: this server knows them, but must not change them now, and mostly must not
/// answer for them. Thread-safe; readers wait only for moments.
class CellBook {
 public:
  explicit CellBook(ServedCells cells) { keep(std::move(cells)); }

  /// The returned cells stay unchanged as long as the book exists. The next call may return more
  /// cells.
  [[nodiscard]] const ServedCells& now() const { return *now_.load(); }

  /// A cell that this server may change; otherwise kNotFound, or kConflict with the reason.
  [[nodiscard]] Result<std::shared_ptr<const Cell>> find(const std::string& name) const {
    if (const auto one = find_apart(name))
      return failure(ErrorCode::kConflict, "{}", one->why).of("cell").with_text(name);
    return find_cell(now(), name);
  }

  /// Sets exactly these cells apart.
  void set_apart(std::map<std::string, ApartCell> cells) {
    const MutexLock lock(apart_mutex_);
    any_apart_ = !cells.empty();
    apart_ = std::move(cells);
  }
  [[nodiscard]] std::optional<ApartCell> find_apart(const std::string& cell) const {
    if (!any_apart_) return std::nullopt;
    const MutexLock lock(apart_mutex_);
    const auto found = apart_.find(cell);
    return found == apart_.end() ? std::nullopt : std::optional(found->second);
  }
  /// Why this server may not answer for the cell; empty: it may.
  [[nodiscard]] std::optional<std::string> why_apart(const std::string& cell) const {
    const auto one = find_apart(cell);
    return one && !one->answers ? std::optional(one->why) : std::nullopt;
  }
  [[nodiscard]] std::map<std::string, ApartCell> apart() const {
    const MutexLock lock(apart_mutex_);
    return apart_;
  }
  /// True if this server answers for all cells that are set apart.
  [[nodiscard]] bool all_answer() const {
    const MutexLock lock(apart_mutex_);
    return std::all_of(apart_.begin(), apart_.end(),
                       [](const auto& named) { return named.second.answers; });
  }

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

  Mutex mutex_;  // one at a time adds
  std::vector<std::unique_ptr<const ServedCells>>
      kept_;  // readers may hold pointers to cells; one map per add()
  std::atomic<const ServedCells*> now_ = nullptr;
  mutable Mutex apart_mutex_;  // taken last
  std::map<std::string, ApartCell> apart_ TRAMMEL_GUARDED_BY(apart_mutex_);
  std::atomic<bool> any_apart_ = false;
};

}  // namespace trammel
