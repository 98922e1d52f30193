#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/dds/dds_options.h"
#include "server/store/store.h"

namespace trammel {

/// Another server of the same cells, as it describes itself.
struct OtherReplica {
  std::string server;
  bool writes = false;
  std::string follows = {};
  std::uint64_t epoch = 0;
  std::map<std::string, VersionInForce> cells = {};  ///< that are served here too, and have a model there
  std::map<std::string, int> newest = {};            ///< the highest number of a version, of cells that are served here
};

/// What this server is to be, and why.
struct RoleDecision {
  ReplicaRecord record;
  std::string why = {};                  ///< one clause, where it writes now and did not, or the other way round
  const OtherReplica* leader = nullptr;  ///< of a follower: the writer that it follows, where it is there
  std::string trouble = {};              ///< two write, none writes, or what else a person should know; empty: nothing
};

/// Decides which one of several servers of the same cells writes, by what each says of itself. No DDS, no clock, no
/// threads. What it promises and what not: README.md.
class ReplicaRole {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// A promotion makes the epoch so much higher.
  static constexpr std::uint64_t kPromotion = std::uint64_t{1} << 32;
  /// So long a server that has just started looks round before it writes.
  static constexpr std::chrono::milliseconds kLookingRound{1000};

  ReplicaRole(std::string self, ReplicaOptions options, Time now)
      : self_(std::move(self)), options_(std::move(options)), started_(now), writer_seen_(now) {}

  /// What a start makes of what the store remembers: the part that was last decided, unless the server file says
  /// another one since.
  [[nodiscard]] RoleDecision begin(const std::optional<ReplicaRecord>& remembered) const;
  /// The server file was read again. Where it says what it said before that decides nothing, but that a server which it
  /// calls the writer takes this up again where nobody writes.
  [[nodiscard]] RoleDecision told(const ReplicaRecord& record, const ReplicaOptions& options,
                                  const std::vector<OtherReplica>& others);
  /// `others` are those that are there now and share a cell; the decision points into them.
  [[nodiscard]] RoleDecision decide(const ReplicaRecord& record, const std::vector<OtherReplica>& others, Time now);
  /// Whether it has looked round since its start.
  [[nodiscard]] bool has_looked(Time now) const { return now - started_ >= kLookingRound; }
  [[nodiscard]] const ReplicaOptions& options() const { return options_; }

 private:
  [[nodiscard]] RoleDecision as_writer(const ReplicaRecord& record, const std::vector<OtherReplica>& others) const;
  [[nodiscard]] RoleDecision as_follower(const ReplicaRecord& record, const std::vector<OtherReplica>& others,
                                         Time now);
  [[nodiscard]] ReplicaRecord promoted(const ReplicaRecord& record, const std::vector<OtherReplica>& others) const;
  /// Why a follower writes from now on, if it does; empty: it does not.
  [[nodiscard]] std::string reason_to_write(const ReplicaRecord& record, const std::vector<OtherReplica>& others,
                                            Time now) const;
  /// As the store remembers it.
  [[nodiscard]] std::string part() const;

  const std::string self_;
  ReplicaOptions options_;
  const Time started_;
  Time writer_seen_;  // last
};

}  // namespace trammel
