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
                               std::chrono::milliseconds writing)
    : socket_(socket), read_until_(Clock::now() + reading), writing_(writing) {
  ::fcntl(socket_, F_SETFL, ::fcntl(socket_, F_GETFL) | O_NONBLOCK);
}

DeadlineStream::~DeadlineStream() { close_with_words(socket_); }

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
    if (!wait(POLLIN, read_until_)) return -1;
    const ssize_t got = ::recv(socket_, buffer_.data(), buffer_.size(), 0);
    if (got == 0) return 0;
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (got < 0) return -1;
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
    if (!wait(POLLOUT, write_until_)) return -1;
    const ssize_t put = ::send(socket_, bytes, size, MSG_NOSIGNAL);
    if (put >= 0) return put;
    if (errno != EAGAIN && errno != EINTR) return -1;
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
