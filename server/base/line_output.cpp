#include "server/base/line_output.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <limits.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace trammel {

LineOutput::LineOutput(int descriptor) : descriptor_(descriptor) {
  struct stat about {};
  if (::fstat(descriptor, &about) != 0) return;
  is_socket_ = S_ISSOCK(about.st_mode);
  is_file_ = S_ISREG(about.st_mode);
  if (!S_ISFIFO(about.st_mode) && !S_ISCHR(about.st_mode)) return;
  const std::string again = fmt::format("/proc/self/fd/{}", descriptor);
  own_ = ::open(again.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
}

LineOutput::~LineOutput() {
  if (own_ >= 0) ::close(own_);
}

void LineOutput::write(std::string_view line) {
  const MutexLock lock(mutex_);
  if (dropped_ > 0 || within_line_) {
    const std::string said = fmt::format("{}{} lines could not be written here and are lost\n",
                                         within_line_ ? "\n" : "", dropped_);
    if (!put(said)) {
      ++dropped_;
      return;
    }
    dropped_ = 0;
    within_line_ = false;
  }
  if (!put(line)) ++dropped_;
}

std::uint64_t LineOutput::dropped() const {
  const MutexLock lock(mutex_);
  return dropped_;
}

bool LineOutput::put(std::string_view text) {
  while (!text.empty()) {
    const long went = put_part(text.substr(0, PIPE_BUF));  // a pipe takes this many bytes
                                                           // completely or not at all
    if (went < 0 && errno == EINTR) continue;
    if (went <= 0) return false;
    within_line_ = text[static_cast<std::size_t>(went) - 1] != '\n';
    text.remove_prefix(static_cast<std::size_t>(went));
  }
  return true;
}

long LineOutput::put_part(std::string_view part) const {
  if (is_socket_) return ::send(descriptor_, part.data(), part.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (is_file_) return ::write(descriptor_, part.data(), part.size());
  if (own_ >= 0) return ::write(own_, part.data(), part.size());
  pollfd room{descriptor_, POLLOUT, 0};
  if (::poll(&room, 1, 0) != 1 || (room.revents & POLLOUT) == 0) return -1;
  return ::write(descriptor_, part.data(), part.size());
}

}  // namespace trammel
