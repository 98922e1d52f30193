#include "tests/support/held_answer.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <string_view>
#include <utility>

#include "server/base/check.h"

namespace trammel::test {
namespace {

constexpr std::string_view kSocket = "/.s.PGSQL.5432", kHost = "host=";
constexpr std::string_view kCommitted{
    "C\0\0\0\x0b"
    "COMMIT\0",
    12};  // PostgreSQL's CommandComplete

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  TRAMMEL_CHECK(path.size() < sizeof(address.sun_path));
  std::memcpy(static_cast<char*>(address.sun_path), path.data(), path.size());
  return address;
}

int new_socket() {
  const int made = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  TRAMMEL_CHECK(made >= 0);
  return made;
}

bool write_all(int to, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::send(to, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

std::string_view read_some(int from, std::array<char, 65536>& room) {
  const ssize_t count = ::read(from, room.data(), room.size());
  return {room.data(), count > 0 ? static_cast<std::size_t>(count) : 0};
}

pid_t process_behind(int socket) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 ? peer.pid : 0;
}

}  // namespace

HeldAnswer::HeldAnswer(const std::string& url) {
  const std::size_t host = url.find(kHost);
  TRAMMEL_CHECK(host != std::string::npos);
  behind_ = url.substr(host + kHost.size()) + std::string(kSocket);
  url_ = url.substr(0, host + kHost.size()) + folder_.path().string();
  listener_ = new_socket();
  const sockaddr_un address = address_of(folder_.path().string() + std::string(kSocket));
  TRAMMEL_CHECK(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) ==
                0);
  TRAMMEL_CHECK(::listen(listener_, 64) == 0);
  end_ = ::eventfd(0, EFD_CLOEXEC);
  TRAMMEL_CHECK(end_ >= 0);
  thread_ = std::thread([this] { carry(); });
}

HeldAnswer::~HeldAnswer() {
  TRAMMEL_CHECK(::eventfd_write(end_, 1) == 0);
  thread_.join();
  for (const Link& link : links_) {
    ::close(link.client);
    ::close(link.server);
  }
  ::close(listener_);
  ::close(end_);
}

void HeldAnswer::hold(const std::string& statement) {
  const MutexLock lock(mutex_);
  statement_ = statement;
  held_ = 0;
}

pid_t HeldAnswer::held(std::chrono::milliseconds limit) {
  MutexLock lock(mutex_);
  changed_.wait_until(lock, std::chrono::steady_clock::now() + limit,
                      [this]() TRAMMEL_REQUIRES(mutex_) { return held_ != 0; });
  return held_;
}

void HeldAnswer::carry() {
  for (;;) {
    std::vector<pollfd> waiting = {{end_, POLLIN, 0}, {listener_, POLLIN, 0}};
    for (const Link& link : links_) {
      waiting.push_back({link.client, POLLIN, 0});
      waiting.push_back({link.server, POLLIN, 0});
    }
    if (::poll(waiting.data(), waiting.size(), -1) < 0) continue;
    if (waiting[0].revents != 0) return;
    std::vector<Link> kept;
    for (std::size_t i = 0; i < links_.size(); ++i) {
      Link& link = links_[i];
      const bool goes_on = (waiting[2 + 2 * i].revents == 0 || carry_to_server(link)) &&
                           (waiting[3 + 2 * i].revents == 0 || carry_to_client(link));
      if (goes_on) {
        kept.push_back(link);
      } else {
        ::close(link.client);
        ::close(link.server);
      }
    }
    links_ = std::move(kept);
    if (waiting[1].revents != 0) accept_one();
  }
}

void HeldAnswer::accept_one() {
  Link link;
  link.client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (link.client < 0) return;
  link.server = new_socket();
  const sockaddr_un address = address_of(behind_);
  if (::connect(link.server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
    return links_.push_back(link);
  ::close(link.client);
  ::close(link.server);
}

bool HeldAnswer::carry_to_server(Link& link) {
  std::array<char, 65536> room{};
  const std::string_view bytes = read_some(link.client, room);
  if (bytes.empty()) return false;
  {
    const MutexLock lock(mutex_);
    const bool is_it = !statement_.empty() && bytes.find(statement_) != std::string_view::npos;
    if (is_it) statement_.clear();
    link.is_to_be_held = link.is_to_be_held || is_it;
  }
  return write_all(link.server, bytes);
}

bool HeldAnswer::carry_to_client(Link& link) {
  std::array<char, 65536> room{};
  const std::string_view bytes = read_some(link.server, room);
  if (bytes.empty()) return false;
  if (link.is_to_be_held && bytes.find(kCommitted) != std::string_view::npos) {
    link.is_held = true;
    const MutexLock lock(mutex_);
    held_ = process_behind(link.client);
    changed_.notify_all();
  }
  return link.is_held || write_all(link.client, bytes);
}

}  // namespace trammel::test
