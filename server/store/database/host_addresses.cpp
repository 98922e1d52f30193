#include "server/store/database/host_addresses.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <sstream>

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kProgram = "/usr/bin/getent";  // of the C library itself

bool is_address(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return ::inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

/// A child program: its output is read, and the destructor ends it.
class Asked {
 public:
  explicit Asked(const std::string& host) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) return;
    output_ = ends[0];
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    std::string program = kProgram, what = "ahosts", name = host;
    std::array<char*, 4> arguments = {program.data(), what.data(), name.data(), nullptr};
    if (::posix_spawn(&child_, kProgram, &actions, nullptr, arguments.data(), environ) != 0)
      child_ = -1;
    ::posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
  }
  ~Asked() {
    if (output_ >= 0) ::close(output_);
    if (child_ < 0) return;
    ::kill(child_, SIGKILL);
    while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) continue;
  }
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;

  [[nodiscard]] bool is_there() const { return child_ >= 0; }
  /// Its complete output; empty: it did not end in time.
  [[nodiscard]] std::optional<std::string> answer(Clock::time_point deadline) const {
    std::string text;
    std::array<char, 4096> buffer{};
    for (;;) {
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
      pollfd one{output_, POLLIN, 0};
      const int ready = left <= 0 ? 0 : ::poll(&one, 1, static_cast<int>(left));
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0) return std::nullopt;
      const ssize_t size = ::read(output_, buffer.data(), buffer.size());
      if (size == 0) return text;
      if (size > 0) text.append(buffer.data(), static_cast<std::size_t>(size));
    }
  }

 private:
  int output_ = -1;
  pid_t child_ = -1;
};

/// The first word of each line, once each: a line is an address, a kind of socket and perhaps the
/// name.
std::vector<std::string> addresses_in(const std::string& lines) {
  std::vector<std::string> addresses;
  std::istringstream in(lines);
  for (std::string line; std::getline(in, line);) {
    const std::string address = line.substr(0, line.find(' '));
    const bool is_new = std::find(addresses.begin(), addresses.end(), address) == addresses.end();
    if (is_new && !address.empty()) addresses.push_back(address);
  }
  return addresses;
}

}  // namespace

Result<std::vector<std::string>> addresses_of(const std::string& host,
                                              std::chrono::milliseconds limit) {
  if (is_address(host)) return std::vector<std::string>{host};
  const Asked asked(host);
  if (!asked.is_there())
    return failure(ErrorCode::kInternal, "{} cannot be started to look up {}", kProgram, host);
  const auto said = asked.answer(Clock::now() + limit);
  constexpr const char* kNext = "see that its name is spelled as it is known here: getent ahosts";
  if (!said)
    return failure(ErrorCode::kUnreachable, "the name {} was not found within {} ms", host,
                   limit.count())
        .next(kNext);
  auto addresses = addresses_in(*said);
  if (addresses.empty())
    return failure(ErrorCode::kUnreachable, "nobody knows a host {}", host).next(kNext);
  return addresses;
}

}  // namespace trammel
