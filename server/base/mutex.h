#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <utility>

/// Locks that the compiler checks. In `deploy/check threads` clang refuses code that uses a member
/// without the lock that guards it. Other compilers ignore the annotations.
#if defined(__clang__)
#define TRAMMEL_THREAD_SAFETY(annotation) __attribute__((annotation))
#else
#define TRAMMEL_THREAD_SAFETY(annotation)
#endif

/// On a member: read and written under this mutex only.
#define TRAMMEL_GUARDED_BY(mutex) TRAMMEL_THREAD_SAFETY(guarded_by(mutex))
/// On a function or a lambda: the caller holds this mutex.
#define TRAMMEL_REQUIRES(mutex) TRAMMEL_THREAD_SAFETY(requires_capability(mutex))
/// On a function: the caller does not hold this mutex. The function locks it.
#define TRAMMEL_EXCLUDES(mutex) TRAMMEL_THREAD_SAFETY(locks_excluded(mutex))

namespace trammel {

/// A std::mutex with annotations. Lock it with MutexLock.
class TRAMMEL_THREAD_SAFETY(capability("mutex")) Mutex {
 public:
  void lock() TRAMMEL_THREAD_SAFETY(acquire_capability()) { mutex_.lock(); }
  void unlock() TRAMMEL_THREAD_SAFETY(release_capability()) { mutex_.unlock(); }

 private:
  std::mutex mutex_;
};

/// Holds a mutex until it is destroyed or unlock() is called.
class TRAMMEL_THREAD_SAFETY(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) TRAMMEL_THREAD_SAFETY(acquire_capability(mutex))
      : lock_(mutex) {}
  ~MutexLock() TRAMMEL_THREAD_SAFETY(release_capability()) = default;
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void lock() TRAMMEL_THREAD_SAFETY(acquire_capability()) { lock_.lock(); }
  void unlock() TRAMMEL_THREAD_SAFETY(release_capability()) { lock_.unlock(); }

 private:
  std::unique_lock<Mutex> lock_;
};

/// A condition variable for Mutex. The lock is held before and after every wait, and released
/// during it. `ready` is called with the lock held: `[this]() TRAMMEL_REQUIRES(mutex_) { return
/// ...; }`. A wait with a limit or a stop token returns the last result of `ready`.
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
  bool wait_until(MutexLock& lock, const std::chrono::time_point<Clock, Duration>& deadline,
                  Ready ready) {
    return condition_.wait_until(lock, deadline, std::move(ready));
  }
  template <typename Clock, typename Duration, typename Ready>
  bool wait_until(MutexLock& lock, const std::stop_token& stop,
                  const std::chrono::time_point<Clock, Duration>& deadline, Ready ready) {
    return condition_.wait_until(lock, stop, deadline, std::move(ready));
  }
  template <typename Rep, typename Period, typename Ready>
  bool wait_for(MutexLock& lock, const std::stop_token& stop,
                const std::chrono::duration<Rep, Period>& limit, Ready ready) {
    return condition_.wait_for(lock, stop, limit, std::move(ready));
  }

 private:
  std::condition_variable_any condition_;
};

}  // namespace trammel
