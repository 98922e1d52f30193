#pragma once

#include <algorithm>
#include <array>
#include <atomic>

#include "idl/repairs/guard/endpoint_watch.h"
#include "idl/repairs/guard/fragment_watch.h"
#include "idl/repairs/guard/participant_watch.h"
#include "idl/repairs/guard/repair_watch.h"
#include "idl/repairs/guard/sequence_watch.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// The guard's memory of senders, and of what was sent.
struct GuardMemory {
  explicit GuardMemory(std::size_t most_endpoints) : endpoints(most_endpoints) {}

  Mutex mutex;
  SequenceWatch sequences TRAMMEL_GUARDED_BY(mutex);
  UnfinishedSamples unfinished TRAMMEL_GUARDED_BY(mutex);
  SentSamples sent TRAMMEL_GUARDED_BY(mutex);
  ParticipantWatch participants TRAMMEL_GUARDED_BY(mutex);
  EndpointWatch endpoints TRAMMEL_GUARDED_BY(mutex);
  RepairWatch repairs TRAMMEL_GUARDED_BY(mutex);
  std::array<unsigned char, kPrefix> own
      TRAMMEL_GUARDED_BY(mutex) = {};        // prefix; zeros: nothing was sent yet
  std::atomic<bool> knows_strangers{false};  // among `participants`

  [[nodiscard]] bool is_own(Bytes prefix) const TRAMMEL_REQUIRES(mutex) {
    return std::equal(own.begin(), own.end(), prefix.begin());
  }
  /// After a change of `participants`.
  void note_strangers() TRAMMEL_REQUIRES(mutex) {
    knows_strangers = participants.knows_strangers();
  }
};

}  // namespace trammel::wire
