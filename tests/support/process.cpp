#include "tests/support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "server/base/check.h"

namespace trammel::test {
namespace {

bool has_line_with(const std::string& text, const std::string& part) {
  const auto found = text.find(part);
  return found != std::string::npos && text.find('\n', found) != std::string::npos;
}

}  // namespace

Process::Process(const std::vector<std::string>& argv) {
  std::array<int, 2> out{}, err{};
  TRAMMEL_CHECK(::pipe2(out.data(), O_CLOEXEC) == 0 && ::pipe2(err.data(), O_CLOEXEC) == 0);
  std::vector<char*> arguments;
  for (const std::string& argument : argv) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  TRAMMEL_CHECK(pid_ >= 0);
  if (pid_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(127);
    ::dup2(out[1], STDOUT_FILENO);
    ::dup2(err[1], STDERR_FILENO);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  ::close(out[1]);
  ::close(err[1]);
  pidfd_ = static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0));
  TRAMMEL_CHECK(pidfd_ >= 0);
  out_reader_ = std::jthread([this, descriptor = out[0]] { read(descriptor, out_); });
  err_reader_ = std::jthread([this, descriptor = err[0]] { read(descriptor, err_); });
}

Process::~Process() {
  if (!exit_code_) {
    ::kill(pid_, SIGKILL);
    int status = 0;
    ::waitpid(pid_, &status, 0);
  }
  ::close(pidfd_);
}

void Process::read(int descriptor, std::string& text) {
  std::array<char, 4096> buffer;
  while (true) {
    const ssize_t size = ::read(descriptor, buffer.data(), buffer.size());
    if (size < 0 && errno == EINTR) continue;
    const std::lock_guard lock(mutex_);
    if (size <= 0) {
      --open_streams_;
    } else {
      text.append(buffer.data(), static_cast<std::size_t>(size));
    }
    changed_.notify_all();
    if (size <= 0) break;
  }
  ::close(descriptor);
}

std::string Process::standard_output() const {
  const std::lock_guard lock(mutex_);
  return out_;
}

std::string Process::standard_error() const {
  const std::lock_guard lock(mutex_);
  return err_;
}

bool Process::wait_for_line(const std::string& part, std::chrono::milliseconds limit) {
  std::unique_lock lock(mutex_);
  const auto seen = [&] { return has_line_with(out_, part) || has_line_with(err_, part); };
  changed_.wait_for(lock, limit, [&] { return seen() || open_streams_ == 0; });
  return seen();
}

void Process::signal(int number) const {
  if (!exit_code_) ::kill(pid_, number);
}

std::optional<int> Process::wait(std::chrono::milliseconds limit) {
  if (exit_code_) return exit_code_;
  pollfd ended{pidfd_, POLLIN, 0};
  if (::poll(&ended, 1, static_cast<int>(limit.count())) != 1) return std::nullopt;
  int status = 0;
  ::waitpid(pid_, &status, 0);
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return open_streams_ == 0; });
  return exit_code_;
}

Finished run(const std::vector<std::string>& argv, std::chrono::milliseconds limit) {
  Process process(argv);
  const auto exit_code = process.wait(limit);
  return {exit_code, process.standard_output(), process.standard_error()};
}

}  // namespace trammel::test
