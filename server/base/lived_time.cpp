#include "server/base/lived_time.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

namespace trammel {
namespace {

/// Closes its descriptor.
struct OpenedForTimes {
  int descriptor;
  explicit OpenedForTimes(const char* path, int flags = 0)
      : descriptor(::open(path, O_RDONLY | O_CLOEXEC | flags)) {}
  ~OpenedForTimes() {
    if (descriptor >= 0) ::close(descriptor);
  }
  OpenedForTimes(const OpenedForTimes&) = delete;
  OpenedForTimes& operator=(const OpenedForTimes&) = delete;
};

/// Calls `use` with the name of each entry of a folder, including `.` and `..`. readdir() would
/// allocate heap memory.
template <typename Use>
void for_each_entry(const char* folder, const Use& use) {
  const OpenedForTimes opened(folder, O_DIRECTORY);
  alignas(dirent64) std::array<char, 4096> entries{};
  while (true) {
    const long length =
        ::syscall(SYS_getdents64, opened.descriptor, entries.data(), entries.size());
    if (length <= 0) return;
    for (long at = 0; at < length;) {
      const auto* entry = reinterpret_cast<const dirent64*>(entries.data() + at);
      use(static_cast<const char*>(entry->d_name));
      at += entry->d_reclen;
    }
  }
}

/// The times of the same thread in `before`, where it is mostly at the same place or some places
/// earlier; a thread that began since has none.
ThreadTimes times_before(std::span<const ThreadTimes> before, const ThreadTimes& after) {
  const auto found = std::find_if(before.begin(), before.end(),
                                  [&](const ThreadTimes& one) { return one.id == after.id; });
  return found == before.end() ? ThreadTimes{after.id} : *found;
}

}  // namespace

double processor_share(std::span<const ThreadTimes> before, std::span<const ThreadTimes> after,
                       std::chrono::nanoseconds passed) {
  double ran = 0, queued = 0, longest = 0;
  for (const ThreadTimes& now : after) {
    const ThreadTimes then = times_before(before, now);
    const auto waited = static_cast<double>(now.queued - std::min(now.queued, then.queued));
    ran += static_cast<double>(now.ran - std::min(now.ran, then.ran));
    queued += waited;
    longest = std::max(longest, waited);
  }
  if (queued <= 0) return 1;
  const double of_all = ran / (ran + queued);
  const auto whole = static_cast<double>(passed.count());
  return std::min(of_all, whole <= 0 ? 1 : std::max(0.0, 1 - longest / whole));
}

void LivedTime::read(Threads& threads) {
  threads.count = 0;
  for_each_entry("/proc/self/task", [&](const char* thread) {
    std::array<char, 300> path{};
    std::snprintf(path.data(), path.size(), "/proc/self/task/%s/schedstat", thread);
    const OpenedForTimes opened(path.data());
    std::array<char, 96> text{};
    if (::read(opened.descriptor, text.data(), text.size() - 1) <= 0) return;
    if (threads.count == kMostThreads) return;
    ThreadTimes& times = threads.times[threads.count++];
    char* rest = nullptr;
    times.id = std::atoi(thread);
    times.ran = std::strtoull(text.data(), &rest, 10);
    times.queued = std::strtoull(rest, nullptr, 10);
  });
}

LivedTime::LivedTime(Milliseconds tick) : tick_(tick) { read(before_); }

LivedTime::Milliseconds LivedTime::since_last() {
  read(after_);
  const Clock::time_point now = Clock::now();
  const auto passed = now - last_;
  const double share =
      processor_share({before_.times.data(), before_.count}, {after_.times.data(), after_.count},
                      std::chrono::duration_cast<std::chrono::nanoseconds>(passed));
  last_ = now;
  before_ = after_;
  return std::chrono::duration_cast<Milliseconds>(std::min<Clock::duration>(passed, tick_) *
                                                  std::max(kLeast, share));
}

}  // namespace trammel
