#include "server/http/deadline_stream.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace trammel {
namespace {

/// Reads the rest of the input. Otherwise closing would reset the connection, and the other side
/// would lose data sent to it.
void read_what_is_left(int socket) {
  std::array<char, 4096> rest{};
  for (int i = 0; i < 16 && ::recv(socket, rest.data(), rest.size(), MSG_DONTWAIT) > 0; ++i)
    continue;
}

}  // namespace

DeadlineStream::DeadlineStream(int socket, std::chrono::milliseconds reading,
                               std::chrono::milliseconds writing, const TlsContext& tls)
    : socket_(socket),
      tls_(tls ? ::SSL_new(tls.get()) : nullptr, ::SSL_free),
      read_until_(Clock::now() + reading),
      writing_(writing) {
  ::fcntl(socket_, F_SETFL, ::fcntl(socket_, F_GETFL) | O_NONBLOCK);
  if (!tls_) return;
  ::SSL_set_fd(tls_.get(), socket_);
  ::SSL_set_accept_state(tls_.get());
}

DeadlineStream::~DeadlineStream() {
  if (released_) return;
  if (tls_) ::SSL_shutdown(tls_.get());
  close_with_words(socket_);
}

std::optional<int> DeadlineStream::released() {
  if (tls_ || broken_ || from_ < to_) return std::nullopt;
  released_ = true;
  return socket_;
}

bool DeadlineStream::wait(short events, Clock::time_point until) const {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    if (left <= 0) return false;
    pollfd look{socket_, events, 0};
    const int ready = ::poll(&look, 1, static_cast<int>(left));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
}

bool DeadlineStream::is_readable() const { return from_ < to_ || wait(POLLIN, read_until_); }

bool DeadlineStream::is_writable() const { return wait(POLLOUT, Clock::now() + writing_); }

ssize_t DeadlineStream::read(char* bytes, std::size_t size) {
  while (from_ == to_) {
    const ssize_t got = get(buffer_.data(), buffer_.size());
    if (got == kWaits && wait(wanted_, read_until_)) continue;
    broken_ = broken_ || got <= 0;
    if (got <= 0) return got == 0 ? 0 : -1;
    from_ = 0;
    to_ = static_cast<std::size_t>(got);
  }
  const std::size_t count = std::min(size, to_ - from_);
  std::memcpy(bytes, buffer_.data() + from_, count);
  from_ += count;
  return static_cast<ssize_t>(count);
}

ssize_t DeadlineStream::write(const char* bytes, std::size_t size) {
  if (write_until_ == Clock::time_point{}) write_until_ = Clock::now() + writing_;
  for (;;) {
    const ssize_t gone = put(bytes, size);
    if (gone >= 0) return gone;
    if (gone == kWaits && wait(wanted_, write_until_)) continue;
    broken_ = true;
    return -1;
  }
}

ssize_t DeadlineStream::get(char* bytes, std::size_t size) {
  if (tls_) return outcome_of_tls(::SSL_read(tls_.get(), bytes, static_cast<int>(size)));
  const ssize_t got = ::recv(socket_, bytes, size, 0);
  wanted_ = POLLIN;
  return got < 0 && (errno == EAGAIN || errno == EINTR) ? kWaits : got;
}

ssize_t DeadlineStream::put(const char* bytes, std::size_t size) {
  if (tls_) {
    constexpr std::size_t kAtOnce = 16384;  // bytes, a record
    return outcome_of_tls(
        ::SSL_write(tls_.get(), bytes, static_cast<int>(std::min(size, kAtOnce))));
  }
  const ssize_t gone = ::send(socket_, bytes, size, MSG_NOSIGNAL);
  wanted_ = POLLOUT;
  return gone < 0 && (errno == EAGAIN || errno == EINTR) ? kWaits : gone;
}

ssize_t DeadlineStream::outcome_of_tls(int done) {
  if (done > 0) return done;
  switch (::SSL_get_error(tls_.get(), done)) {
    case SSL_ERROR_WANT_READ:
      wanted_ = POLLIN;
      return kWaits;
    case SSL_ERROR_WANT_WRITE:
      wanted_ = POLLOUT;
      return kWaits;
    case SSL_ERROR_ZERO_RETURN:
      return 0;
    default:
      return -1;
  }
}

void DeadlineStream::get_remote_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

void DeadlineStream::get_local_ip_and_port(std::string& ip, int& port) const {
  get_remote_ip_and_port(ip, port);
}

void close_with_words(int socket) {
  ::shutdown(socket, SHUT_WR);
  read_what_is_left(socket);
  ::close(socket);
}

}  // namespace trammel
