#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include "server/dds/schedule/cost_book.h"
#include "server/dds/schedule/job.h"
#include "server/dds/schedule/room.h"

namespace trammel {

struct TurnLimits {
  std::size_t workers = 2;
  /// Additional workers for short requests only. They mostly sleep, so the system runs them at once
  /// while the other workers compete for the cores.
  std::size_t express_workers = 0;
  Cost portion{0.002};  ///< a worker goes to the next request after this, or after one item
  std::size_t client_requests = 64;  ///< of one client that wait or are processed
  std::size_t requests = 4096;       ///< of all clients
  double cell_share = 0.5;           ///< of `requests`, for one cell
  std::size_t client_workers = 64;   ///< that work for one client at a time
  std::size_t cell_workers = 64;     ///< that work for one cell at a time
};

/// Chooses the next request for a worker. The client with the least of the workers' time so far is
/// next. So a client with many or long requests waits behind its own requests, and takes turns with
/// the others portion by portion. A client that was away starts level with the others. Among
/// clients with equal time, the one that has waited longest for a portion comes first. No lock, no
/// clock, no thread.
class Turns {
 public:
  explicit Turns(const TurnLimits& limits) : limits_(limits) {}

  /// Sets the limits for waiting requests: per client, in total, and per cell; other limits stay.
  void set_limits(const TurnLimits& limits);

  /// A request from its admission to its answer.
  class Entry {
   public:
    Entry(std::shared_ptr<Job> job, Ask ask, Room::Place place, Cost left)
        : job_(std::move(job)), ask_(std::move(ask)), place_(std::move(place)), left_(left) {}
    [[nodiscard]] Job& job() { return *job_; }
    /// The next `most` items, or fewer; `first` is their first. 0: none is left. Thread-safe.
    [[nodiscard]] std::size_t claim(std::size_t most, std::size_t* first);
    /// True if these were the last items. Thread-safe.
    [[nodiscard]] bool computed(std::size_t count) {
      return computed_.fetch_add(count) + count == items_;
    }

   private:
    friend class Turns;
    enum class State { kWaits, kBegins, kOpen, kOver };
    const std::shared_ptr<Job> job_;
    const Ask ask_;
    const Room::Place place_;
    State state_ = State::kWaits;
    Cost left_;  // estimated
    std::size_t items_ = 0;
    std::atomic<std::size_t> next_{0};      // item to be claimed
    std::atomic<std::size_t> computed_{0};  // items
    std::size_t running_ = 0;               // portions under way
    bool given_up_ = false;
  };

  enum class Part { kBegin, kCompute, kShed };
  /// The next piece of work of a worker. settle() ends it.
  struct Portion {
    std::shared_ptr<Entry> entry;
    Part part = Part::kBegin;
    Shed shed = {};  ///< why, of kShed
  };

  /// The outcome of a portion.
  struct Done {
    Cost took{0};           ///< the whole portion
    Cost computing{0};      ///< the part of it for the items
    std::size_t items = 0;  ///< computed
    bool answered = false;  ///< the request is over with it
  };

  /// Adds the request, or says why not. A request that cannot finish in time, by the known costs,
  /// is not added.
  [[nodiscard]] std::optional<Shed> add(std::shared_ptr<Job> job, Ask ask, Room::Place place,
                                        SteadyTime now);
  /// The requests to consider: all, or those that one portion finishes by the known costs.
  enum class Which { kAll, kShort };
  /// Empty when there is nothing that may be worked on.
  [[nodiscard]] std::optional<Portion> next(SteadyTime now, Which which = Which::kAll);
  /// True if next(kAll) would give a portion.
  [[nodiscard]] bool has_work() const;
  /// Removes and returns a request without a worker whose time is over; empty if there is none.
  [[nodiscard]] std::optional<Portion> next_late(SteadyTime now);
  /// After Job::begin(): other workers may join.
  void open(Entry& entry, std::size_t items);
  /// Ends a portion of another kind than kShed. True: the request is given up and no worker has it
  /// any longer, so the caller sheds it.
  [[nodiscard]] bool settle(const Portion& portion, const Done& done, SteadyTime now);

  /// When a client whose request found no room should try again.
  [[nodiscard]] std::chrono::milliseconds retry_after(const std::string& client) const;
  /// Requests that wait or are worked on.
  [[nodiscard]] std::size_t requests() const { return requests_; }
  /// Takes out everything that nobody works on.
  [[nodiscard]] std::deque<std::shared_ptr<Entry>> clear();

 private:
  struct Client {
    double had = 0;           // s of the workers' time; at least `level_` after a pause
    std::uint64_t turn = 0;   // number of its last portion
    std::size_t running = 0;  // portions under way
    Cost backlog{0};          // estimated
    std::deque<std::shared_ptr<Entry>> entries;  // oldest first
  };
  struct CellUse {
    std::size_t requests = 0;
    std::size_t running = 0;  // portions under way
  };

  [[nodiscard]] std::optional<Shed> refusal(const Client& client, const Ask& ask, Cost own,
                                            SteadyTime now) const;
  /// The time until the client has had `own` more, everybody being served in turn.
  [[nodiscard]] Cost served_in(const Client& client, Cost own, std::size_t items) const;
  [[nodiscard]] Client& arrived(const std::string& client);
  [[nodiscard]] bool may_run(const Entry& entry) const;
  [[nodiscard]] bool is_short(const Entry& entry) const;
  [[nodiscard]] std::shared_ptr<Entry> workable(const Client& client, Which which) const;
  [[nodiscard]] Portion hand_out(Client& client, std::shared_ptr<Entry> entry, SteadyTime now);
  [[nodiscard]] std::optional<Shed> too_late(const Client& client, const Entry& entry,
                                             SteadyTime now) const;
  void remove(Client& client, Entry& entry);
  void forget_clients();

  TurnLimits limits_;
  CostBook costs_;
  std::unordered_map<std::string, Client> clients_;
  std::unordered_map<std::string, CellUse> cells_;
  std::size_t requests_ = 0;
  double level_ = 0;         // the time of the client that was served last
  std::uint64_t turns_ = 0;  // portions handed out
};

}  // namespace trammel
