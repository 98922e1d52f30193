#include "server/store/connection.h"

#include <algorithm>

#include "server/base/unix_time.h"

namespace trammel {
namespace {

constexpr std::size_t kMostDamages = 100;  // the most that are reported

}  // namespace

StoreState StoreConnection::state() const {
  const MutexLock guard(state_mutex);
  return state_now;
}

void StoreConnection::note_trouble(const Error& why, bool unreadable) {
  {
    const MutexLock guard(state_mutex);
    if (!state_now.why_not_written) state_now.since = unix_now();
    state_now.why_not_written = why;
    state_now.readable = !unreadable;
    ++state_now.failed_writes;
  }
  state_changed.notify_all();
}

void StoreConnection::note_written() {
  {
    const MutexLock guard(state_mutex);
    if (!state_now.why_not_written) return;
    state_now.why_not_written.reset();
    state_now.readable = true;
    state_now.since = unix_now();
  }
  state_changed.notify_all();
}

void StoreConnection::note_damage(const std::string& what) {
  const MutexLock guard(state_mutex);
  if (is_shared() && !state_now.readable) return;  // it is away, which is reported already
  auto& damages = state_now.damages;
  if (damages.size() < kMostDamages &&
      std::find(damages.begin(), damages.end(), what) == damages.end())
    damages.push_back(what);
}

std::optional<std::chrono::seconds> StoreConnection::note_clock() {
  const MutexLock guard(state_mutex);
  const auto step = clock.look(ClockWatch::now());
  if (!step) return step;
  const auto off = clock.off();
  state_now.clock = off.count() == 0
                        ? ""
                        : fmt::format(
                              "the host's clock was set by {:+} s while the service ran: dates "
                              "from before, or since, are wrong (trammel audit says when)",
                              off.count());
  return step;
}

void StoreConnection::wait_without_word(const std::stop_token& stop,
                                        std::chrono::steady_clock::time_point until) {
  Mutex mutex;  // local: used only to wait
  Condition never;
  MutexLock lock(mutex);
  const auto left =
      std::chrono::ceil<std::chrono::milliseconds>(until - std::chrono::steady_clock::now());
  never.wait_for(lock, stop, std::max(left, std::chrono::milliseconds(0)), [] { return false; });
}

}  // namespace trammel
