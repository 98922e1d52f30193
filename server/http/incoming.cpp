#include "server/http/incoming.h"

#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <string_view>
#include <utility>

namespace trammel {
namespace {

constexpr std::size_t kLongestHead = 16384;  // bytes
constexpr int kTick = 50;                    // ms, between looks at who is late

void close_at_once(int socket) {
  ::shutdown(socket, SHUT_RDWR);
  ::close(socket);
}

}  // namespace

struct Incoming::Head {
  enum { kNotYet, kThere, kTooLong } arrival = kNotYet;
  std::string bytes;
};

// A connection that has ended sends nothing more.
// A record has its kind, its version and its length before it. What begins otherwise is for the
// handshake to refuse.
Incoming::Head Incoming::first_record(const std::string& bytes) {
  constexpr std::size_t kBefore = 5;
  constexpr char kHandshake = 0x16;
  if (bytes.empty() || bytes[0] != kHandshake) return {Head::kThere, {}};
  if (bytes.size() < kBefore) return {};
  const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(bytes[at]); };
  const std::size_t whole = kBefore + (std::size_t{byte(3)} << 8 | byte(4));
  if (whole > kLongestHead) return {Head::kTooLong, {}};
  return {bytes.size() < whole ? Head::kNotYet : Head::kThere, {}};
}

Incoming::Head Incoming::head_of(int socket) const {
  std::string bytes(kLongestHead, '\0');
  const ssize_t size = ::recv(socket, bytes.data(), bytes.size(), MSG_PEEK | MSG_DONTWAIT);
  if (size < 0 && (errno == EAGAIN || errno == EINTR)) return {};
  bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  if (tls_) return first_record(bytes);
  if (size <= 0 || bytes.find("\r\n\r\n") != std::string::npos)
    return {Head::kThere, std::move(bytes)};
  return {bytes.size() == kLongestHead ? Head::kTooLong : Head::kNotYet, {}};
}

void Incoming::take(int socket, const Head& head) const {
  head.arrival == Head::kThere ? come_(socket, head.bytes) : close_at_once(socket);
}

Incoming::Incoming(std::size_t most, std::chrono::milliseconds patience, Come come,
                   PushedOut pushed_out, bool tls)
    : most_(most),
      patience_(patience),
      come_(std::move(come)),
      pushed_out_(std::move(pushed_out)),
      tls_(tls),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      wakes_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  epoll_event event{EPOLLIN, {.fd = wakes_}};
  ::epoll_ctl(epoll_, EPOLL_CTL_ADD, wakes_, &event);
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

Incoming::~Incoming() {
  stop();
  ::close(wakes_);
  ::close(epoll_);
}

void Incoming::stop() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  wake();
  thread_.join();
  const MutexLock lock(mutex_);
  stopped_ = true;
  for (const Slow& one : slow_) one.kept ? close_at_once(one.socket) : pushed_out_(one.socket);
  slow_.clear();
}

// On one host the request is mostly there when the connection is: then it never waits here.
void Incoming::add(int socket) { wait_for(socket, patience_, false); }

void Incoming::keep(int socket) { wait_for(socket, kIdle, true); }

void Incoming::wait_for(int socket, std::chrono::milliseconds patience, bool kept) {
  const Head head = head_of(socket);
  std::optional<Slow> out;
  {
    const MutexLock lock(mutex_);
    if (stopped_) return close_at_once(socket);
    if (head.arrival == Head::kNotYet) {
      out = make_room();
      slow_.push_back({socket, std::chrono::steady_clock::now() + patience, kept});
      epoll_event event{EPOLLIN | EPOLLRDHUP | EPOLLET, {.fd = socket}};
      ::epoll_ctl(epoll_, EPOLL_CTL_ADD, socket, &event);
    }
  }
  if (head.arrival != Head::kNotYet) return take(socket, head);
  if (out) send_out(*out);
  wake();
}
std::optional<Incoming::Slow> Incoming::make_room() {
  if (slow_.size() < most_ || slow_.empty()) return std::nullopt;
  auto one = std::find_if(slow_.begin(), slow_.end(), [](const Slow& any) { return any.kept; });
  if (one == slow_.end()) one = slow_.begin();
  const Slow out = *one;
  slow_.erase(one);
  ::epoll_ctl(epoll_, EPOLL_CTL_DEL, out.socket, nullptr);
  return out;
}

// Its request may have come just now.
void Incoming::send_out(const Slow& one) const {
  const Head head = head_of(one.socket);
  if (head.arrival != Head::kNotYet) return take(one.socket, head);
  one.kept ? close_at_once(one.socket) : pushed_out_(one.socket);
}

void Incoming::watch(const std::stop_token& stop) {
  become_http_thread("http incoming");
  while (!stop.stop_requested()) {
    const bool is_idle = [this] {
      const MutexLock lock(mutex_);
      return slow_.empty();
    }();
    std::array<epoll_event, 32> events{};
    const int count =
        ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), is_idle ? -1 : kTick);
    for (int i = 0; i < count; ++i) look_at(events[static_cast<std::size_t>(i)].data.fd);
    close_late();
  }
}

void Incoming::look_at(int socket) {
  if (socket == wakes_) {
    std::uint64_t times = 0;
    static_cast<void>(::read(wakes_, &times, sizeof(times)));
    return;
  }
  Head head;
  {
    const MutexLock lock(mutex_);  // nobody closes it meanwhile
    const auto is_it = [&](const Slow& one) { return one.socket == socket; };
    if (std::none_of(slow_.begin(), slow_.end(), is_it)) return;
    head = head_of(socket);
    if (head.arrival == Head::kNotYet) return;
    std::erase_if(slow_, is_it);
    ::epoll_ctl(epoll_, EPOLL_CTL_DEL, socket, nullptr);
  }
  take(socket, head);
}

void Incoming::close_late() {
  const MutexLock lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  std::erase_if(slow_, [&](const Slow& one) {
    if (now < one.until) return false;
    close_at_once(one.socket);  // which also removes it from epoll
    return true;
  });
}

void become_http_thread(const char* name) {
  constexpr int kNiceness = 10;
  ::pthread_setname_np(::pthread_self(), name);
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()),
                kNiceness);  // this thread alone, which Linux allows
}

void Incoming::wake() const {
  const std::uint64_t once = 1;
  static_cast<void>(::write(wakes_, &once, sizeof(once)));
}

}  // namespace trammel
