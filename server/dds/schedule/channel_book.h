#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/dds/schedule/job.h"

namespace trammel {

/// A client's reader of replies, as discovery found it.
struct ReplyReader {
  std::string participant;
  std::string partition;
  std::string topic;

  bool operator==(const ReplyReader&) const = default;
};

/// Records which participants listen where, and which clients have a reply channel. Only the first
/// participant that listens in a partition gets replies there. If there are more clients than
/// channels, idle ones take turns: the one with the oldest last request makes room for the one that
/// has waited longest, asking clients first. A client that had a channel without using it waits
/// longer each time, and so does one that uses one name after the other: at most 12 s among few
/// clients and 30 s among hundreds. Not thread-safe.
class ChannelBook {
 public:
  /// `grace`: nobody loses a channel sooner than this after it was opened or used.
  ChannelBook(std::size_t capacity, SteadyTime::duration grace)
      : capacity_(capacity), grace_(grace) {}

  void found(const ReplyReader& reader, SteadyTime now);
  void lost(const ReplyReader& reader);
  void left(const std::string& participant);

  /// True if the participant may be answered in the partition: it listens there, or nobody does
  /// yet.
  [[nodiscard]] bool may_listen(const std::string& participant, const std::string& partition) const;
  [[nodiscard]] bool listens(const std::string& participant, const std::string& partition) const;
  /// A request of this client has arrived. True: it has no channel, and had not asked for one.
  bool asked(const std::string& partition, SteadyTime now);
  /// The request has been answered. Between the two the client keeps its channel.
  void answered(const std::string& partition, SteadyTime now);

  /// A step for the caller to take now.
  struct Change {
    enum class Kind { kOpen, kClose } kind;
    std::string partition;
    std::string topic;             ///< for kOpen: one of the topics that the client listens to
    std::string participant = {};  ///< of kOpen: the client's
  };
  [[nodiscard]] std::vector<Change> changes(SteadyTime now);
  /// True if clients wait for a channel.
  [[nodiscard]] bool somebody_waits() const { return open_ < clients_.size(); }
  [[nodiscard]] std::size_t open() const { return open_; }

 private:
  struct Client {
    std::string participant;
    std::set<std::string> topics;  // topics that it listens to
    std::vector<ReplyReader>
        others;  // other participants that listen there; they follow when it has left
    std::set<std::string> opened;  // topics with a writer
    bool is_open = false;
    bool was_useful = false;   // since it was opened
    bool asks = false;         // since it has no channel
    int at_work = 0;           // requests that are not answered
    SteadyTime last_used{};    // or opened
    SteadyTime waits_since{};  // may lie ahead: it waits its turn
    SteadyTime not_before{};   // its participant has come under many names
    SteadyTime::duration penalty{0};
  };
  /// A participant, which may be several clients.
  struct Listener {
    int partitions = 0;      // number of partitions in which it listens
    SteadyTime next_free{};  // when its next partition would cost nothing; may lie ahead
  };
  using Clients = std::map<std::string, Client>;
  [[nodiscard]] Clients::iterator first_waiting(SteadyTime now);
  [[nodiscard]] Clients::iterator least_useful(SteadyTime now);
  void open(Client& client, SteadyTime now);
  void close(Clients::iterator client, SteadyTime now, std::vector<Change>* changes);
  void drop(Clients::iterator client);
  void found_beside(const ReplyReader& reader, Client* client);
  void forget_listeners(SteadyTime now);

  const std::size_t capacity_;
  const SteadyTime::duration grace_;
  Clients clients_;                            // by partition
  std::map<std::string, Listener> listeners_;  // by participant
  std::vector<Change> closings_;               // of clients that have left
  std::size_t open_ = 0;
};

}  // namespace trammel
