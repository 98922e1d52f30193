#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <utility>

/// Locks that the compiler checks: `deploy/check threads` has clang refuse a member that is touched without the lock it
/// is guarded by. To other compilers the annotations are nothing.
#if defined(__clang__)
#define TRAMMEL_THREAD_SAFETY(annotation) __attribute__((annotation))
#else
#define TRAMMEL_THREAD_SAFETY(annotation)
#endif

/// Of a member: read and written under this mutex only.
#define TRAMMEL_GUARDED_BY(mutex) TRAMMEL_THREAD_SAFETY(guarded_by(mutex))
/// Of a function or of a lambda: whoever calls it holds this mutex.
#define TRAMMEL_REQUIRES(mutex) TRAMMEL_THREAD_SAFETY(requires_capability(mutex))
/// Of a function: whoever calls it does not hold this mutex; the function takes it.
#define TRAMMEL_EXCLUDES(mutex) TRAMMEL_THREAD_SAFETY(locks_excluded(mutex))

namespace trammel {

/// A std::mutex that clang knows by name. Lock it by MutexLock.
class TRAMMEL_THREAD_SAFETY(capability("mutex")) Mutex {
 public:
  void lock() TRAMMEL_THREAD_SAFETY(acquire_capability()) { mutex_.lock(); }
  void unlock() TRAMMEL_THREAD_SAFETY(release_capability()) { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

/// Holds a mutex as long as it lives, but for where it is let go in between by unlock().
class TRAMMEL_THREAD_SAFETY(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) TRAMMEL_THREAD_SAFETY(acquire_capability(mutex)) : lock_(mutex) {}
  ~MutexLock() TRAMMEL_THREAD_SAFETY(release_capability()) = default;
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void lock() TRAMMEL_THREAD_SAFETY(acquire_capability()) { lock_.lock(); }
  void unlock() TRAMMEL_THREAD_SAFETY(release_capability()) { lock_.unlock(); }

 private:
  std::unique_lock<Mutex> lock_;
};

/// What one thread waits for and another brings about. Every wait begins and ends with the lock held, and lets it go in
/// between; `ready` is called under it: `[this]() TRAMMEL_REQUIRES(mutex_) { return ...; }`. Waits with a limit, or
/// with a stop token, return what `ready` said last.
class Condition {
 public:
  void notify_one() noexcept { condition_.notify_one(); }
  void notify_all() noexcept { condition_.notify_all(); }

  template <typename Ready>
  void wait(MutexLock& lock, Ready ready) {
    condition_.wait(lock, std::move(ready));
  }
  template <typename Ready>
  bool wait(MutexLock& lock, const std::stop_token& stop, Ready ready) {
    return condition_.wait(lock, stop, std::move(ready));
  }
  template <typename Clock, typename Duration, typename Ready>
  bool wait_until(MutexLock& lock, const std::chrono::time_point<Clock, Duration>& deadline, Ready ready) {
    return condition_.wait_until(lock, deadline, std::move(ready));
  }
  template <typename Clock, typename Duration, typename Ready>
  bool wait_until(MutexLock& lock, const std::stop_token& stop,
                  const std::chrono::time_point<Clock, Duration>& deadline, Ready ready) {
    return condition_.wait_until(lock, stop, deadline, std::move(ready));
  }
  template <typename Rep, typename Period, typename Ready>
  bool wait_for(MutexLock& lock, const std::stop_token& stop, const std::chrono::duration<Rep, Period>& limit,
                Ready ready) {
    return condition_.wait_for(lock, stop, limit, std::move(ready));
  }

 private:
  std::condition_variable_any condition_;
};

}  // namespace trammel
