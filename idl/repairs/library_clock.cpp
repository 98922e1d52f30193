#include "idl/repairs/library_clock.h"

#include <fastdds/rtps/common/Time_t.h>

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace trammel::wire {
namespace {

using std::chrono::nanoseconds;

/// Unix time when the steady clock began.
nanoseconds beginning() {
  static const nanoseconds at = std::chrono::system_clock::now().time_since_epoch() -
                                std::chrono::steady_clock::now().time_since_epoch();
  return at;
}

nanoseconds library_time() {
  return std::max(nanoseconds(0),
                  beginning() + std::chrono::steady_clock::now().time_since_epoch());
}

}  // namespace

void start_library_clock() { static_cast<void>(beginning()); }

}  // namespace trammel::wire

// The library calls its own function of this name through the table of symbols, where a program's
// stands before it.
__attribute__((visibility("default"))) void eprosima::fastrtps::rtps::Time_t::now(Time_t& time) {
  const auto now = trammel::wire::library_time();
  const auto whole = std::chrono::duration_cast<std::chrono::seconds>(now);
  time.seconds(static_cast<std::int32_t>(whole.count() & INT32_MAX));
  time.nanosec(static_cast<std::uint32_t>((now - whole).count()));
}
