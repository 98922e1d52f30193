#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>

#include "server/dds/schedule/job.h"

namespace trammel {

struct OutboxLimits {
  std::size_t client_replies = 1024;
  std::size_t client_bytes = 64u << 20;
  std::size_t bytes = 256u << 20;
};

/// A reply on its way.
struct Parcel {
  std::string client;     ///< the client that asked: its replies share a limit
  std::string partition;  ///< the partition in which it listens
  std::string topic;
  std::shared_ptr<void> reply;
  std::size_t bytes = 0;  ///< of memory
  SteadyTime until{};     ///< when it is dropped
};

/// Replies that cannot be written yet, because nobody listens or because their thread must not
/// write. Not thread-safe.
class Outbox {
 public:
  explicit Outbox(const OutboxLimits& limits) : limits_(limits) {}

  /// False, and the parcel is dropped, when there is no room.
  [[nodiscard]] bool put(Parcel parcel);
  /// Takes out replies that `may_go`, oldest first, at most `most`.
  [[nodiscard]] std::list<Parcel> take(std::size_t most,
                                       const std::function<bool(const Parcel&)>& may_go);
  /// Drops expired replies. Returns their number.
  std::size_t expire(SteadyTime now);
  [[nodiscard]] bool empty() const { return parcels_.empty(); }
  [[nodiscard]] bool has_for(const std::string& partition) const;
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  struct Held {
    std::size_t replies = 0;
    std::size_t bytes = 0;
  };
  std::list<Parcel>::iterator remove(std::list<Parcel>::iterator parcel, std::list<Parcel>* to);

  const OutboxLimits limits_;
  std::list<Parcel> parcels_;           // oldest first
  std::map<std::string, Held> held_;    // by client
  std::map<std::string, int> listens_;  // parcels by partition
  std::size_t bytes_ = 0;
};

}  // namespace trammel
