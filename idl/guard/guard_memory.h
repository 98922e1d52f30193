#pragma once

#include "idl/guard/fragment_watch.h"
#include "idl/guard/participant_watch.h"
#include "idl/guard/sequence_watch.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// What the guard remembers of those who send, and of what was sent.
struct GuardMemory {
  Mutex mutex;
  SequenceWatch sequences TRAMMEL_GUARDED_BY(mutex);
  UnfinishedSamples unfinished TRAMMEL_GUARDED_BY(mutex);
  SentSamples sent TRAMMEL_GUARDED_BY(mutex);
  ParticipantWatch participants TRAMMEL_GUARDED_BY(mutex);
};

}  // namespace trammel::wire
