#include "server/store/connection.h"

#include <algorithm>

#include "server/base/unix_time.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kBetweenTries{1};  // to open a file that cannot be written
constexpr std::size_t kMostDamages = 100;         // that are told

}  // namespace

Status StoreConnection::open_anew() {
  if (!must_be_opened_anew_) return {};
  const auto now = std::chrono::steady_clock::now();
  if (now < tried_last_ + kBetweenTries) return tl::make_unexpected(*state().why_not_written);
  tried_last_ = now;
  database.reset();  // one connection at a time: its locks are the process's
  auto opened = open_database(path, *copies);
  if (!opened) {
    note_trouble(opened.error(), true);
    return tl::make_unexpected(opened.error());
  }
  database = std::move(opened->file);
  if (opened->why_not_written) {
    note_trouble(*opened->why_not_written, database == nullptr);
    return tl::make_unexpected(*opened->why_not_written);
  }
  must_be_opened_anew_ = false;
  return {};
}

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
  auto& damages = state_now.damages;
  if (damages.size() < kMostDamages && std::find(damages.begin(), damages.end(), what) == damages.end())
    damages.push_back(what);
}

}  // namespace trammel
