#pragma once

#include <map>
#include <string>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"

namespace trammel {

/// Whose reply partition is whose, as discovery tells: it belongs to the participant whose reply reader was found in it
/// first, for as long as that has one there. Nobody makes the server write into another client's partition.
/// Thread-safe.
class PartitionOwners {
 public:
  using Reader = eprosima::fastrtps::rtps::GUID_t;

  /// A reader that is known moves to the partition.
  void found(const Reader& reader, const std::string& partition);
  void left(const Reader& reader);

  /// Whether replies to this participant (wire::participant_of()) may go there: it owns the partition, or nobody has a
  /// reader there yet.
  [[nodiscard]] bool may_use(const std::string& partition, const std::string& participant) const;

 private:
  void forget(const Reader& reader) TRAMMEL_REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::map<std::string, std::vector<Reader>> readers_ TRAMMEL_GUARDED_BY(mutex_);  // by partition, the owner's first
  std::map<Reader, std::string> partitions_ TRAMMEL_GUARDED_BY(mutex_);            // by reader
};

}  // namespace trammel
