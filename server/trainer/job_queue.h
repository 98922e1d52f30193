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

/// A job that waits. The store has all of it.
struct WaitingJob {
  std::int64_t id = 0;
  std::string cell;
  bool asked_for = false;  ///< by a person; else it came with a batch
};

/// A job whose turn has come, and how it learns that it is to end.
struct TakenJob {
  WaitingJob job;
  std::stop_token cancelled;
};

/// The jobs that wait, those of a cell in their order, the cells in turn: many jobs of one cell
/// hold up each other, and another cell's by one at most. Without a limit of its own: what came
/// with a batch is accepted, and an id is small. Thread-safe; one thread takes.
class JobQueue {
 public:
  void push(WaitingJob job);
  /// Puts a job back where it was taken from: it is the next one of its cell.
  void push_front(WaitingJob job);
  /// From now on the jobs wait, or do so no longer; one that is taken goes on.
  void hold(bool held);
  /// Waits for a job; empty once `stop` is requested.
  [[nodiscard]] std::optional<TakenJob> take(const std::stop_token& stop);
  /// The job that was taken is over. Until then cancel() finds it.
  void put_down();

  enum class Cancelled {
    kRemoved,   ///< it waited, and does not any more
    kStopping,  ///< its turn has come: its token was told
    kUnknown    ///< it is not here
  };
  /// `who` asks for it, as the audit trail names people; empty: nobody knows.
  [[nodiscard]] Cancelled cancel(std::int64_t id, const std::string& who = {});
  /// Who asked that the job which is taken ends; empty: nobody did, or nobody knows who.
  [[nodiscard]] std::string cancelled_by() const;
  /// Takes a job that waits out of the queue; false: it does not wait here.
  [[nodiscard]] bool remove(std::int64_t id);
  /// Takes all jobs of a cell that wait here out of the queue.
  void remove_cell(const std::string& cell);

  /// Those that wait here, and the one whose turn has come.
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
  std::string last_cell_ TRAMMEL_GUARDED_BY(mutex_);  // whose turn it was
  std::optional<std::int64_t> taken_ TRAMMEL_GUARDED_BY(mutex_);
  std::stop_source cancelling_ TRAMMEL_GUARDED_BY(mutex_);  // of the one taken
  std::string cancelled_by_ TRAMMEL_GUARDED_BY(mutex_);     // likewise
};

}  // namespace trammel
