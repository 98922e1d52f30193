#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "idl/limits.h"

namespace trammel {

/// The time for which a reply is kept for a reader that is not matched: DDS matches it within a few
/// announcements, or never.
inline constexpr auto kReplyPatience = wire::kLease;

/// The destination of a reply.
struct ReplyAddress {
  std::string participant;  ///< the participant that sent the request
  std::string partition;    ///< the partition in which it says it listens
  std::string topic;
};

/// Takes replies. Never waits for the reader. Thread-safe.
class ReplySink {
 public:
  virtual ~ReplySink() = default;
  /// Sends the reply, at once where that is possible. `reply` is a sample of the topic's type, of
  /// about so many bytes.
  virtual void send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) = 0;
  /// send() for threads that must not write: another one does.
  virtual void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) = 0;
};

}  // namespace trammel
