#include "server/host/caught_signals.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <utility>

#include "server/base/check.h"
#include "server/base/lived_time.h"

namespace trammel {

namespace {

constexpr std::array kCaught = {SIGTERM, SIGINT, SIGHUP};
constexpr std::chrono::milliseconds kOrderlyStop{10'000};
constexpr std::chrono::milliseconds kTick{250};
constexpr unsigned char kOver = 0;  // in the pipe: not a signal, but the end of the object

std::atomic<int> pipe_to_write = -1;
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler reads it");

void write_number(unsigned char number) {
  const int before = errno;
  const int pipe = pipe_to_write.load();
  // A full pipe holds more signals than anybody needs.
  if (pipe >= 0) static_cast<void>(::write(pipe, &number, 1));
  errno = before;
}

void handle(int number) { write_number(static_cast<unsigned char>(number)); }

/// `how`: SIG_BLOCK or SIG_UNBLOCK, in this thread and in threads that it starts later.
void mask(int how) {
  sigset_t caught;
  ::sigemptyset(&caught);
  for (const int number : kCaught) ::sigaddset(&caught, number);
  ::pthread_sigmask(how, &caught, nullptr);
}

}  // namespace

CaughtSignals::CaughtSignals(std::function<void()> hangs,
                             std::function<std::chrono::milliseconds()> lived)
    : hangs_(std::move(hangs)), lived_(std::move(lived)) {
  std::array<int, 2> ends = {};
  TRAMMEL_CHECK(::pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) == 0);
  numbers_ = ends[0];
  TRAMMEL_CHECK(pipe_to_write.exchange(ends[1]) == -1);
  struct sigaction action {};
  action.sa_handler = handle;
  action.sa_flags = SA_RESTART;
  for (const int number : kCaught) ::sigaction(number, &action, nullptr);
  mask(SIG_BLOCK);
  thread_ = std::jthread([this](const std::stop_token& over) { take(over); });
}

CaughtSignals::~CaughtSignals() {
  thread_.request_stop();
  write_number(kOver);
  thread_.join();
  ::close(pipe_to_write.exchange(-1));
  ::close(numbers_);
}

CaughtSignals::News CaughtSignals::wait(std::chrono::milliseconds limit) {
  MutexLock lock(mutex_);
  came_.wait_for(lock, std::stop_token(), limit,
                 [this]() TRAMMEL_REQUIRES(mutex_) { return news_.ends != 0 || news_.reload; });
  return std::exchange(news_, {});
}

void CaughtSignals::take(const std::stop_token& over) {
  ::pthread_setname_np(::pthread_self(), "signals");
  mask(SIG_UNBLOCK);
  pollfd readable{numbers_, POLLIN, 0};
  int number = SIGHUP;
  while (number == SIGHUP) {
    unsigned char read = kOver;
    if (::read(numbers_, &read, 1) != 1) {
      ::poll(&readable, 1, -1);
      continue;
    }
    if (over.stop_requested()) return;
    number = read;
    note(number);
  }
  watch_the_end(over);
}

void CaughtSignals::note(int number) {
  {
    const MutexLock lock(mutex_);
    if (number == SIGHUP) {
      news_.reload = true;
    } else {
      news_.ends = number;
    }
  }
  came_.notify_all();
}

void CaughtSignals::watch_the_end(const std::stop_token& over) const {
  pollfd readable{numbers_, POLLIN, 0};
  LivedTime measured(kTick);
  for (std::chrono::milliseconds waited{0}; waited < kOrderlyStop;) {
    ::poll(&readable, 1, static_cast<int>(kTick.count()));
    unsigned char ignored = kOver;  // further requests change nothing
    static_cast<void>(::read(numbers_, &ignored, 1));
    if (over.stop_requested()) return;
    waited += lived_ ? lived_() : measured.since_last();
  }
  hangs_();
}

}  // namespace trammel
