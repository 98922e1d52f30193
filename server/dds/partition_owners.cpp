#include "server/dds/partition_owners.h"

#include <algorithm>

namespace trammel {

void PartitionOwners::found(const Reader& reader, const std::string& partition) {
  const MutexLock lock(mutex_);
  const auto known = partitions_.find(reader);
  if (known != partitions_.end() && known->second == partition) return;
  forget(reader);
  partitions_[reader] = partition;
  auto& readers = readers_[partition];
  // Those of one participant stand together, so that the owner is whoever came first as long as it has one left.
  const auto same = [&](const Reader& other) { return other.guidPrefix == reader.guidPrefix; };
  const auto last = std::find_if(readers.rbegin(), readers.rend(), same);
  readers.insert(last == readers.rend() ? readers.end() : last.base(), reader);
}

void PartitionOwners::left(const Reader& reader) {
  const MutexLock lock(mutex_);
  forget(reader);
}

bool PartitionOwners::may_use(const std::string& partition, const std::string& participant) const {
  const MutexLock lock(mutex_);
  const auto found = readers_.find(partition);
  return found == readers_.end() || wire::participant_of(found->second.front()) == participant;
}

void PartitionOwners::forget(const Reader& reader) {
  const auto known = partitions_.find(reader);
  if (known == partitions_.end()) return;
  const auto entry = readers_.find(known->second);
  std::erase(entry->second, reader);
  if (entry->second.empty()) readers_.erase(entry);
  partitions_.erase(known);
}

}  // namespace trammel
