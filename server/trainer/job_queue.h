#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>

#include "server/base/mutex.h"

namespace trammel {

/// A waiting job. The store has all of its data.
struct WaitingJob {
  std::int64_t id = 0;
  std::string cell;
  bool asked_for = false;  ///< by a person; otherwise it came with a batch
};

/// A job whose turn has come, and the signals for its end.
struct TakenJob {
  WaitingJob job;
  std::stop_token cancelled;
};

/// The waiting jobs. Jobs of a cell stay in order, and the cells take turns. Many jobs of one cell
/// delay each other, and those of another cell by at most one. The queue has no limit of its own,
/// since jobs of accepted batches must be kept and an id is small. Thread-safe; one thread takes
/// jobs.
class JobQueue {
 public:
  void push(WaitingJob job);
  /// Returns a job to its place: it is the next one of its cell.
  void push_front(WaitingJob job);
  /// From now on the jobs wait, or do so no longer; one that is taken goes on.
  void hold(bool held);
  /// Waits for a job; empty once `stop` is requested.
  [[nodiscard]] std::optional<TakenJob> take(const std::stop_token& stop);
  /// The job that was taken is over. Until then cancel() finds it.
  void put_down();

  enum class Cancelled {
    kRemoved,   ///< it waited, and is removed
    kStopping,  ///< its turn has come, and its token has the stop request
    kUnknown    ///< it is not here
  };
  /// `who` requests it, as named in the audit trail; empty: unknown.
  [[nodiscard]] Cancelled cancel(std::int64_t id, const std::string& who = {});
  /// The person who requested the end of the taken job; empty: nobody, or unknown.
  [[nodiscard]] std::string cancelled_by() const;
  /// Removes a waiting job from the queue. Returns false if the job does not wait here.
  [[nodiscard]] bool remove(std::int64_t id);
  /// Takes all jobs of a cell that wait here out of the queue.
  void remove_cell(const std::string& cell);

  /// The jobs that wait here, and the one whose turn has come.
  [[nodiscard]] std::set<std::int64_t> jobs() const;
  [[nodiscard]] std::size_t size() const;
  /// The number of the cell's jobs that were asked for.
  [[nodiscard]] std::size_t asked_for(const std::string& cell) const;

 private:
  [[nodiscard]] WaitingJob next() TRAMMEL_REQUIRES(mutex_);
  [[nodiscard]] bool is_removed(std::int64_t id) TRAMMEL_REQUIRES(mutex_);

  mutable Mutex mutex_;
  Condition ready_;  // there are jobs
  std::map<std::string, std::deque<WaitingJob>> waiting_
      TRAMMEL_GUARDED_BY(mutex_);  // by cell; none is empty
  bool held_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::string last_cell_ TRAMMEL_GUARDED_BY(mutex_);  // the cell of the last turn
  std::optional<std::int64_t> taken_ TRAMMEL_GUARDED_BY(mutex_);
  std::stop_source cancelling_ TRAMMEL_GUARDED_BY(mutex_);  // for the taken job
  std::string cancelled_by_ TRAMMEL_GUARDED_BY(mutex_);     // likewise
};

}  // namespace trammel
