#include "server/dds/replicas/replica_role.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace trammel {
namespace {

using Role = ReplicaOptions::Role;

/// The newer epoch comes first; of two that are as new, the smaller name.
bool comes_before(std::uint64_t epoch, const std::string& server, std::uint64_t other_epoch, const std::string& other) {
  return epoch != other_epoch ? epoch > other_epoch : server < other;
}

const OtherReplica* first_writer(const std::vector<OtherReplica>& others) {
  const OtherReplica* first = nullptr;
  for (const OtherReplica& other : others) {
    if (!other.writes) continue;
    if (first == nullptr || comes_before(other.epoch, other.server, first->epoch, first->server)) first = &other;
  }
  return first;
}

}  // namespace

std::string ReplicaRole::part() const {
  return options_.role == Role::kWriter ? "writer" : "follower of " + options_.of;
}

ReplicaRecord ReplicaRole::promoted(const ReplicaRecord& record, const std::vector<OtherReplica>& others) const {
  std::uint64_t newest = record.epoch;
  for (const OtherReplica& other : others) newest = std::max(newest, other.epoch);
  // No epoch is newer than the last one, whatever somebody claims.
  const std::uint64_t promotions =
      std::min(newest / kPromotion + 1, std::numeric_limits<std::uint64_t>::max() / kPromotion);
  return {promotions * kPromotion, true, "", part()};
}

RoleDecision ReplicaRole::begin(const std::optional<ReplicaRecord>& remembered) const {
  const bool is_to_write = options_.role == Role::kWriter;
  if (!remembered) return {{is_to_write ? 1U : 0U, is_to_write, options_.of, part()}, "the server file says so"};
  if (remembered->told == part()) return {*remembered};
  if (is_to_write && !remembered->writes) return {promoted(*remembered, {}), "the server file says so now"};
  return {{remembered->epoch, is_to_write, options_.of, part()}, "the server file says so now"};
}

RoleDecision ReplicaRole::told(const ReplicaRecord& record, const ReplicaOptions& options,
                               const std::vector<OtherReplica>& others) {
  options_ = options;
  const bool nobody_writes = first_writer(others) == nullptr;
  const bool asks_again = options_.role == Role::kWriter && !record.writes && nobody_writes;
  if (part() == record.told && !asks_again) return {record};
  if (options_.role == Role::kFollower) return {{record.epoch, false, options_.of, part()}, "the server file says so"};
  if (!record.writes) return {promoted(record, others), "the server file says so now"};
  return {{record.epoch, true, "", part()}};
}

RoleDecision ReplicaRole::decide(const ReplicaRecord& record, const std::vector<OtherReplica>& others, Time now) {
  if (record.told != part()) return told(record, ReplicaOptions(options_), others);  // the store could not remember it
  return record.writes ? as_writer(record, others) : as_follower(record, others, now);
}

RoleDecision ReplicaRole::as_writer(const ReplicaRecord& record, const std::vector<OtherReplica>& others) const {
  RoleDecision decision{record};
  for (const OtherReplica& other : others) {
    const bool is_newer =
        other.writes ? comes_before(other.epoch, other.server, record.epoch, self_) : other.epoch > record.epoch;
    if (other.writes)
      decision.trouble = fmt::format("two servers write: {} (epoch {}) and {} (epoch {}); {} stops", self_,
                                     record.epoch, other.server, other.epoch, is_newer ? self_ : other.server);
    if (!is_newer) continue;
    decision.record.writes = false;
    decision.record.follows = other.writes ? other.server : other.follows == self_ ? "" : other.follows;
    decision.why =
        other.writes
            ? fmt::format("{} writes, and its epoch {} comes before {}", other.server, other.epoch, record.epoch)
            : fmt::format("{} has epoch {}, newer than {}: this store is older than what was in force", other.server,
                          other.epoch, record.epoch);
    return decision;
  }
  return decision;
}

RoleDecision ReplicaRole::as_follower(const ReplicaRecord& record, const std::vector<OtherReplica>& others, Time now) {
  RoleDecision decision{record};
  const OtherReplica* writer = first_writer(others);
  if (writer != nullptr) writer_seen_ = now;
  if (writer != nullptr && writer->epoch >= record.epoch) {
    decision.leader = writer;
    decision.record.follows = writer->server;
    return decision;
  }
  if (writer != nullptr) {
    decision.trouble = fmt::format("{} writes with epoch {}, older than {}: it is not followed", writer->server,
                                   writer->epoch, record.epoch);
    return decision;
  }
  decision.why = reason_to_write(record, others, now);
  if (!decision.why.empty()) {
    decision.record = promoted(record, others);
  } else if (now - writer_seen_ > kLookingRound) {
    decision.trouble = "no server writes: changes wait until one is promoted (role: writer in its server file)";
  }
  return decision;
}

std::string ReplicaRole::reason_to_write(const ReplicaRecord& record, const std::vector<OtherReplica>& others,
                                         Time now) const {
  if (!has_looked(now)) return {};
  for (const OtherReplica& other : others) {
    if (other.epoch > record.epoch) return {};  // that one has more
  }
  const bool is_handed_over =
      std::any_of(others.begin(), others.end(), [&](const OtherReplica& other) { return other.follows == self_; });
  if (options_.role == Role::kWriter && is_handed_over) return "others follow it, and its server file says writer";
  const std::chrono::duration<double> alone = now - writer_seen_;
  if (options_.promote_after_s <= 0 || alone.count() < options_.promote_after_s) return {};
  const bool is_first = std::none_of(others.begin(), others.end(), [&](const OtherReplica& other) {
    return comes_before(other.epoch, other.server, record.epoch, self_);
  });
  return is_first ? fmt::format("nobody has written for {:.1f} s", alone.count()) : std::string();
}

}  // namespace trammel
