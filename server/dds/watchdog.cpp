#include "server/dds/watchdog.h"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <utility>

#include "server/base/mutex.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

/// Formats without the heap, because the hanging thread may hold the heap's lock.
[[noreturn]] void end_hung(const std::vector<const char*>& stopped) {
  std::array<char, 256> names{};
  for (const char* name : stopped) {
    const std::size_t length = std::strlen(names.data());
    std::snprintf(names.data() + length, names.size() - length, "%s%s", length == 0 ? "" : ", ",
                  name);
  }
  std::array<char, 512> line{};
  std::snprintf(
      line.data(), line.size(),
      "trammeld: hangs: no progress for %.1f s in: %s; ends at once, to be started again\n",
      static_cast<double>(Watchdog::kLimit.count()) / 1000, names.data());
  end_at_once(line.data());
}

}  // namespace

void end_at_once(const char* line) {
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&out, 1, 0) == 1 && (out.revents & POLLOUT) != 0) {
    static_cast<void>(!::write(STDERR_FILENO, line, std::strlen(line)));
  }
  ::_exit(kExitHung);
}

Watchdog::Watchdog(std::vector<MovingPart> parts)
    : parts_(std::move(parts)),
      stillness_(parts_, kTick, kLimit),
      thread_([this](const std::stop_token& stop) { watch(stop); }) {}

std::vector<std::string> Watchdog::still() const {
  std::vector<std::string> names;
  const std::uint64_t still = still_;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if ((still >> i & 1) != 0) names.emplace_back(parts_[i].name);
  }
  if (Clock::now().time_since_epoch() - looked_.load() >= kLong) names.emplace_back("watchdog");
  return names;
}

void Watchdog::watch(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "watchdog");
  Mutex mutex;  // local: used only to wait for the next look
  Condition never;
  MutexLock lock(mutex);
  while (!stop.stop_requested()) {
    never.wait_for(lock, stop, kTick, [] { return false; });
    const auto stopped = stillness_.look(lived_.since_last());
    still_ = stillness_.still_for(kLong);
    looked_ = Clock::now().time_since_epoch();
    if (!stopped.empty() && !stop.stop_requested()) end_hung(stopped);
  }
}

}  // namespace trammel
