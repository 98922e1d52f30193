#include "idl/repairs/quiet_library.h"

#include <atomic>
#include <fastdds/dds/log/Log.hpp>

namespace trammel::wire {
namespace {

std::atomic<int> living = 0;

}  // namespace

// Earlier messages are shown, messages written meanwhile are not: the library tells its errors
// in a thread of its own.
QuietLibrary::QuietLibrary() {
  eprosima::fastdds::dds::Log::Flush();
  ++living;
}

QuietLibrary::~QuietLibrary() {
  eprosima::fastdds::dds::Log::Flush();
  --living;
}

bool QuietLibrary::lives() { return living > 0; }

}  // namespace trammel::wire
