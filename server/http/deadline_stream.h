#pragma once

#include <httplib.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "server/http/tls.h"

namespace trammel {

/// A connection that ends when its time is over, however slowly the other side sends or reads.
/// Closes it at the end. With TLS the handshake is part of the first read.
class DeadlineStream final : public httplib::Stream {
 public:
  using Clock = std::chrono::steady_clock;

  /// `tls` null: without TLS.
  DeadlineStream(int socket, std::chrono::milliseconds reading, std::chrono::milliseconds writing,
                 const TlsContext& tls = nullptr);
  ~DeadlineStream() override;
  DeadlineStream(const DeadlineStream&) = delete;
  DeadlineStream& operator=(const DeadlineStream&) = delete;

  using httplib::Stream::write;
  [[nodiscard]] bool is_readable() const override;
  [[nodiscard]] bool is_writable() const override;
  ssize_t read(char* bytes, std::size_t size) override;
  ssize_t write(const char* bytes, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  [[nodiscard]] int socket() const override { return socket_; }

  /// The connection, for its next request: it is open, and nothing of it is left unread here.
  /// Otherwise, and with TLS, nothing, and it is closed at the end.
  [[nodiscard]] std::optional<int> released();

 private:
  /// Until the socket is ready for `events`; false once `until` is over.
  [[nodiscard]] bool wait(short events, Clock::time_point until) const;

  /// The bytes taken or given; 0: the other side has ended; kWaits: once the socket is ready for
  /// `wanted_`; else an error.
  [[nodiscard]] ssize_t get(char* bytes, std::size_t size);
  [[nodiscard]] ssize_t put(const char* bytes, std::size_t size);
  [[nodiscard]] ssize_t outcome_of_tls(int done);
  static constexpr ssize_t kWaits = -2;

  const int socket_;
  bool broken_ = false, released_ = false;
  const std::unique_ptr<SSL, void (*)(SSL*)> tls_;  // null: without
  short wanted_ = 0;                                // of poll()
  const Clock::time_point read_until_;
  const std::chrono::milliseconds writing_;
  Clock::time_point write_until_{};  // set by the first byte written
  std::array<char, 4096> buffer_{};
  std::size_t from_ = 0, to_ = 0;  // the unread part of the buffer
};

/// Ends a connection so that the other side can still read the data sent to it.
void close_with_words(int socket);

}  // namespace trammel
