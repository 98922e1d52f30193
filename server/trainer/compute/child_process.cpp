#include "server/trainer/compute/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <fstream>
#include <string_view>
#include <utility>

namespace trammel {

namespace {

constexpr int kKilledIsGone = 1000;  // ms that a killed process is waited for

Failure failed(const char* what, int error) {
  return failure(ErrorCode::kInternal, "the process to compute in cannot be started: {}: {}", what,
                 std::strerror(error));
}

/// Moves a descriptor above the standard streams and the channel. Those are set up one after the
/// other, and none may overwrite a descriptor that is still needed.
int out_of_the_way(int descriptor) {
  if (descriptor < 0 || descriptor > ChildProcess::kChannel) return descriptor;
  const int moved = ::fcntl(descriptor, F_DUPFD_CLOEXEC, ChildProcess::kChannel + 1);
  ::close(descriptor);
  return moved;
}

using Pair = std::pair<Descriptor, Descriptor>;

/// The first end is ours and does not block.
Result<Pair> socket_pair() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    return failed("socketpair", errno);
  Pair pair{Descriptor(out_of_the_way(ends[0])), Descriptor(out_of_the_way(ends[1]))};
  ::fcntl(pair.first.get(), F_SETFL, O_NONBLOCK);
  return pair;
}

Result<Pair> pipe_of_words() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return failed("pipe2", errno);
  Pair pair{Descriptor(out_of_the_way(ends[0])), Descriptor(out_of_the_way(ends[1]))};
  ::fcntl(pair.first.get(), F_SETFL, O_NONBLOCK);
  return pair;
}

/// The descriptors and settings that the child gets, and those that it loses.
class SpawnPlan {
 public:
  SpawnPlan(int channel, int words) {
    ::posix_spawn_file_actions_init(&actions_);
    ::posix_spawn_file_actions_addopen(&actions_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&actions_, words, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions_, words, STDERR_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions_, channel, ChildProcess::kChannel);
    ::posix_spawn_file_actions_addclosefrom_np(&actions_, ChildProcess::kChannel + 1);
    sigset_t none, all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
    ::posix_spawnattr_init(&attributes_);
    ::posix_spawnattr_setsigmask(&attributes_, &none);
    ::posix_spawnattr_setsigdefault(&attributes_, &all);
    ::posix_spawnattr_setpgroup(&attributes_, 0);
    ::posix_spawnattr_setflags(
        &attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~SpawnPlan() {
    ::posix_spawn_file_actions_destroy(&actions_);
    ::posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  /// 0, or the error.
  int start(const std::vector<std::string>& argv, pid_t& pid) const {
    std::vector<char*> arguments;
    for (const std::string& argument : argv)
      arguments.push_back(const_cast<char*>(argument.c_str()));
    arguments.push_back(nullptr);
    std::vector<char*> environment = environment_of_child();
    return ::posix_spawn(&pid, arguments[0], &actions_, &attributes_, arguments.data(),
                         environment.data());
  }

 private:
  /// This process's environment, with one thread for linear algebra: otherwise OpenBLAS starts one
  /// per processor when it is loaded.
  static std::vector<char*> environment_of_child() {
    static std::string one_thread = "OPENBLAS_NUM_THREADS=1";
    std::vector<char*> all = {one_thread.data()};
    for (char** entry = environ; *entry != nullptr; ++entry)
      if (!std::string_view(*entry).starts_with("OPENBLAS_NUM_THREADS=")) all.push_back(*entry);
    all.push_back(nullptr);
    return all;
  }

  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

std::string first_line_of(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  return line;
}

/// Bytes of VmHWM in /proc/PID/status; 0 where there is none.
std::int64_t peak_memory_of(pid_t pid) {
  std::ifstream in(fmt::format("/proc/{}/status", pid));
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("VmHWM:")) return std::strtoll(line.c_str() + 6, nullptr, 10) * 1024;
  }
  return 0;
}

double processor_time_of(pid_t pid) {
  clockid_t clock{};
  timespec time{};
  if (::clock_getcpuclockid(pid, &clock) != 0 || ::clock_gettime(clock, &time) != 0) return 0;
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  close();
  number_ = other.release();
  return *this;
}

int Descriptor::release() { return std::exchange(number_, -1); }

void Descriptor::close() {
  if (number_ >= 0) ::close(std::exchange(number_, -1));
}

Result<std::unique_ptr<ChildProcess>> ChildProcess::start(const std::vector<std::string>& argv) {
  auto channel = TRY(socket_pair());
  auto words = TRY(pipe_of_words());
  std::unique_ptr<ChildProcess> child(new ChildProcess());
  pid_t pid = -1;
  const int error = SpawnPlan(channel.second.get(), words.second.get()).start(argv, pid);
  if (error != 0) return failed(argv.front().c_str(), error);
  child->pid_ = pid;
  child->channel_ = std::move(channel.first);
  child->words_ = std::move(words.first);
  child->pidfd_ = Descriptor(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
  if (child->pidfd_.get() < 0) return failed("pidfd_open", errno);
  return child;
}

ChildProcess::~ChildProcess() { kill(); }

void ChildProcess::kill() {
  if (pid_ < 0 || reap()) return;
  static_cast<void>(usage());
  ::kill(pid_, SIGKILL);
  pollfd gone{pidfd_.get(), POLLIN, 0};
  while (::poll(&gone, 1, kKilledIsGone) < 0 && errno == EINTR) continue;
  reap();
}

bool ChildProcess::reap() {
  if (status_) return true;
  rusage used{};
  int status = 0;
  const pid_t reaped = ::wait4(pid_, &status, WNOHANG, &used);
  if (reaped == 0) return false;
  status_ =
      reaped == pid_ ? status : 0;  // otherwise another thread reaped it, and its status is lost
  if (reaped != pid_) return true;
  usage_.processor_time = seconds(used.ru_utime) + seconds(used.ru_stime);
  // used.ru_maxrss is not usable: it includes the memory of this process, which the child shared
  // until its exec.
  return true;
}

std::optional<std::string> ChildProcess::ending() {
  if (!reap()) return std::nullopt;
  if (WIFSIGNALED(*status_))
    return fmt::format("signal {} ({})", WTERMSIG(*status_), ::strsignal(WTERMSIG(*status_)));
  return fmt::format("exit code {}", WEXITSTATUS(*status_));
}

ChildProcess::Usage ChildProcess::usage() {
  if (status_) return usage_;
  usage_.processor_time = std::max(usage_.processor_time, processor_time_of(pid_));
  usage_.peak_memory = std::max(usage_.peak_memory, peak_memory_of(pid_));
  return usage_;
}

ChildProcess::State ChildProcess::state() const {
  const std::string line = first_line_of(fmt::format("/proc/{}/stat", pid_));
  const std::size_t name_end = line.rfind(')');
  const char state =
      name_end == std::string::npos || name_end + 2 >= line.size() ? 'R' : line[name_end + 2];
  if (state == 'R') return State::kRuns;
  return state == 'D' ? State::kWaitsForDisk : State::kStands;
}

std::int64_t memory_of_host() {
  const std::int64_t physical = std::int64_t{::sysconf(_SC_PHYS_PAGES)} * ::sysconf(_SC_PAGESIZE);
  const std::string line = first_line_of("/sys/fs/cgroup/memory.max");  // a container's own
  std::int64_t limit = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), limit);
  return error == std::errc{} && limit > 0 ? std::min(physical, limit) : physical;
}

}  // namespace trammel
