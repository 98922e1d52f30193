#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace trammel {

/// Connections whose request has not arrived yet. They occupy no worker: one thread watches all of
/// them, and hands on each one whose request head is complete. A slow client holds up nobody: if
/// there is no room, the slowest connection is closed, before all others one that was kept for a
/// further request. Thread-safe.
class Incoming {
 public:
  using Come =
      std::function<void(int socket, const std::string& head)>;  ///< closes it, sooner or later
  static constexpr std::chrono::seconds kIdle{10};    ///< how long a kept connection may be idle
  using PushedOut = std::function<void(int socket)>;  ///< closes it

  /// `come`: takes a connection that can be read at once. `pushed_out`: takes connections that made
  /// room, and those that still wait at the end.
  /// With `tls` a connection is handed on once its first record is complete, with an empty head.
  Incoming(std::size_t most, std::chrono::milliseconds patience, Come come, PushedOut pushed_out,
           bool tls = false);
  ~Incoming();  ///< calls stop()
  /// From now on nothing is handed on, and every connection is closed.
  void stop();
  Incoming(const Incoming&) = delete;
  Incoming& operator=(const Incoming&) = delete;

  void add(int socket);
  /// Of a connection that has had an answer: it may stay idle for a while.
  void keep(int socket);

 private:
  using Time = std::chrono::steady_clock::time_point;
  struct Slow {
    int socket;
    Time until;
    bool kept;
  };

  struct Head;
  [[nodiscard]] static Head first_record(const std::string& bytes);
  [[nodiscard]] Head head_of(int socket) const;
  /// Hands on a connection with a complete head, and closes one whose head is too long.
  void take(int socket, const Head& head) const;
  void watch(const std::stop_token& stop);
  void wait_for(int socket, std::chrono::milliseconds patience, bool kept);
  void look_at(int socket);
  void close_late();
  [[nodiscard]] std::optional<Slow> make_room() TRAMMEL_REQUIRES(mutex_);
  void send_out(const Slow& one) const;
  void wake() const;

  const std::size_t most_;
  const std::chrono::milliseconds patience_;
  const Come come_;
  const PushedOut pushed_out_;
  const bool tls_;
  const int epoll_, wakes_;
  Mutex mutex_;
  std::vector<Slow> slow_ TRAMMEL_GUARDED_BY(mutex_);  // oldest first
  bool stopped_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

/// Names the calling thread and lowers its priority: answering on DDS comes first.
void become_http_thread(const char* name);

}  // namespace trammel
