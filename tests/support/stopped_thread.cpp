#include "tests/support/stopped_thread.h"

#include <sys/ptrace.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace trammel::test {

std::vector<ThreadOf> threads_of(pid_t process) {
  std::vector<ThreadOf> threads;
  std::error_code gone;
  for (const auto& entry :
       std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task", gone)) {
    ThreadOf thread{std::stoi(entry.path().filename()), {}};
    std::ifstream(entry.path() / "comm") >> thread.name;
    threads.push_back(thread);
  }
  std::sort(threads.begin(), threads.end(),
            [](const ThreadOf& a, const ThreadOf& b) { return a.id < b.id; });
  return threads;
}

StoppedThread::StoppedThread(pid_t thread) : thread_(thread) {
  if (::ptrace(PTRACE_SEIZE, thread_, nullptr, nullptr) != 0) return;
  int status = 0;
  stopped_ = ::ptrace(PTRACE_INTERRUPT, thread_, nullptr, nullptr) == 0 &&
             ::waitpid(thread_, &status, __WALL) == thread_ && WIFSTOPPED(status);
}

StoppedThread::~StoppedThread() {
  if (stopped_) ::ptrace(PTRACE_DETACH, thread_, nullptr, nullptr);
}

void StoppedThread::bury() {
  if (!stopped_) return;
  int status = 0;
  // Until it is gone; other stops on its way out are ignored.
  while (::waitpid(thread_, &status, __WALL) == thread_ && WIFSTOPPED(status)) {
    ::ptrace(PTRACE_CONT, thread_, nullptr, nullptr);
  }
  stopped_ = false;
}

}  // namespace trammel::test
