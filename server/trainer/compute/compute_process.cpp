#include "server/trainer/compute/compute_process.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <functional>
#include <utility>

#include "server/tasks/train/given_up.h"
#include "server/trainer/compute/messages.h"
#include "server/trainer/compute/workbench.h"

namespace trammel {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kTick{100};
constexpr int kTicksStill = 10;  // ticks without processor time, for a process that does not want
                                 // any
constexpr int kTicksForDisk = 300;   // ticks for a process that waits for the disk
constexpr double kAnyTime = 0.5e-3;  // s, of the processor in a tick: less is none
constexpr std::size_t kWordsKept = 600;
constexpr std::int64_t kLeastMemory = std::int64_t{256}
                                      << 20;  // bytes, of a job where the host has little

std::int64_t memory_mb_of(const ComputeOptions& options) {
  if (options.memory_mb > 0) return options.memory_mb;
  return std::max(memory_of_host() / 2, kLeastMemory) >> 20;
}

/// The last line of a program's output, for a message: without control characters.
std::string last_words(const std::string& words) {
  const std::size_t end = words.find_last_not_of("\r\n ");
  if (end == std::string::npos) return "";
  const std::size_t before = words.find_last_of('\n', end);
  std::string line =
      words.substr(before == std::string::npos ? 0 : before + 1, end - (before + 1) + 1);
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return line;
}

}  // namespace

/// Wakes the thread that waits for the process when a stop is requested.
class ComputeProcess::Wake {
 public:
  explicit Wake(const StopRequests& stop)
      : stop_(stop),
        event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        service_(stop.service, Call{event_.get()}),
        job_(stop.job, Call{event_.get()}) {}
  [[nodiscard]] int event() const { return event_.get(); }
  [[nodiscard]] bool is_asked() const { return stop_.any(); }

 private:
  struct Call {
    int event;
    void operator()() const {
      const std::uint64_t one = 1;
      static_cast<void>(::write(event, &one, sizeof one));
    }
  };
  const StopRequests stop_;
  const Descriptor event_;
  const std::stop_callback<Call> service_, job_;
};

ComputeProcess::ComputeProcess(const ComputeOptions& options, std::unique_ptr<ChildProcess> child,
                               const StopRequests& stop)
    : options_(options), child_(std::move(child)), wake_(std::make_unique<Wake>(stop)) {}

ComputeProcess::~ComputeProcess() = default;

Result<std::unique_ptr<ComputeProcess>> ComputeProcess::start(const ComputeOptions& options,
                                                              const ComputeTask& task,
                                                              const StopRequests& stop) {
  std::vector<std::string> argv = options.program;
  for (const std::int64_t limit :
       {std::int64_t{::getpid()}, memory_mb_of(options), std::int64_t{options.cpu_s}})
    argv.push_back(std::to_string(limit));
  auto child = TRY(ChildProcess::start(argv));
  std::unique_ptr<ComputeProcess> process(new ComputeProcess(options, std::move(child), stop));
  for (const Frame& frame : message::of_task(task)) {
    if (!process->send(frame)) break;  // make() says why
  }
  return process;
}

Status ComputeProcess::take(const BatchText& batch, bool judges) {
  return send(message::of_batch(batch, judges));
}

Result<Made> ComputeProcess::make(const ComputeWatch& watch) {
  TRY(send(message::make()));
  const auto frame = TRY(answer(watch));
  try {
    return message::to_made(frame);
  } catch (const nlohmann::json::exception& error) {
    return broken(Breakdown::Kind::kCrashed,
                  failure(ErrorCode::kInternal, "not understood: {}", error.what()));
  }
}

Result<GateVerdict> ComputeProcess::judge(const Opponents& opponents) {
  for (const Frame& frame : message::of_opponents(opponents)) {
    TRY(send(frame));
  }
  const auto frame = TRY(answer({}));
  try {
    return message::to_verdict(frame);
  } catch (const nlohmann::json::exception& error) {
    return broken(Breakdown::Kind::kCrashed,
                  failure(ErrorCode::kInternal, "not understood: {}", error.what()));
  }
}

ComputeCost ComputeProcess::cost() const {
  const ChildProcess::Usage usage = child_->usage();
  ComputeCost cost;
  cost.processor_time = usage.processor_time;
  if (usage.peak_memory > 0) cost.peak_memory = usage.peak_memory;
  return cost;
}

Status ComputeProcess::send(const Frame& frame) {
  if (breakdown_) return tl::make_unexpected(breakdown_->error);
  const std::string bytes = encoded(frame);
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t n = ::send(child_->channel(), bytes.data() + sent, bytes.size() - sent,
                             MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n >= 0) {
      sent += static_cast<std::size_t>(n);
    } else if (errno == EAGAIN || errno == EINTR) {
      TRY(wait(POLLOUT));
    } else {
      return crashed();
    }
  }
  return {};
}

Result<Frame> ComputeProcess::answer(const ComputeWatch& watch) {
  while (true) {
    auto frame = reader_.next();
    if (!frame) return broken(Breakdown::Kind::kCrashed, Failure(frame.error()));
    if (!*frame) {
      TRY(wait(POLLIN));
      TRY(receive());
      continue;
    }
    const std::string kind = message::kind_of(**frame);
    if (kind == "made" || kind == "verdict") return std::move(**frame);
    TRY(heard(**frame, watch));
  }
}

Status ComputeProcess::heard(const Frame& frame, const ComputeWatch& watch) {
  try {
    const std::string kind = message::kind_of(frame);
    if (kind == "progress" && watch.progress) {
      if (!watch.progress(frame.head.at("stage"), frame.head.at("share")))
        return broken(Breakdown::Kind::kStopped, given_up());
    } else if (kind == "found" && watch.found) {
      const message::Findings found = message::to_findings(frame);
      return watch.found(found.findings, found.page);
    } else if (kind == "error") {
      bool over_memory = false;
      Error error = message::to_error(frame, over_memory);
      if (!over_memory) return Failure(std::move(error));
      const auto limit = memory_mb_of(options_);
      return broken(
          Breakdown::Kind::kOverMemory,
          failure(ErrorCode::kTooLarge, "its computing asks for more than {} MiB of memory", limit)
              .of("memory_mb")
              .beyond(limit, limit)
              .next("fewer poses or a simpler bias, or a larger memory_mb in the server file"));
    }
    return {};
  } catch (const nlohmann::json::exception& error) {
    return broken(Breakdown::Kind::kCrashed,
                  failure(ErrorCode::kInternal, "not understood: {}", error.what()));
  }
}

Status ComputeProcess::wait(short events) {
  if (Clock::now() >
      next_tick_ + kTick) {  // the caller was late, and the process may have waited for it
    next_tick_ = Clock::now() + kTick;
    ticks_still_ = 0;
    time_at_last_tick_ = -1;
  }
  while (true) {
    if (wake_->is_asked()) return broken(Breakdown::Kind::kStopped, given_up());
    if (Clock::now() >= next_tick_) {
      next_tick_ = Clock::now() + kTick;
      TRY(look_after());
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_tick_ - Clock::now());
    std::array<pollfd, 4> polled = {{{child_->channel(), events, 0},
                                     {child_->words(), POLLIN, 0},
                                     {child_->end(), POLLIN, 0},
                                     {wake_->event(), POLLIN, 0}}};
    if (child_->words() < 0) polled[1].events = 0;
    ::poll(polled.data(), polled.size(), std::max(0, static_cast<int>(left.count())));
    if (polled[1].revents != 0) read_words();
    if ((polled[0].revents & events) != 0) return {};
    if (polled[2].revents != 0 || polled[0].revents != 0) return crashed();
  }
}

Status ComputeProcess::look_after() {
  const double time = child_->usage().processor_time;
  if (time > options_.cpu_s) {
    return broken(Breakdown::Kind::kOverTime,
                  failure(ErrorCode::kTooLarge,
                          "its computing took more than {} s of processor time", options_.cpu_s)
                      .of("cpu_s")
                      .beyond(time, options_.cpu_s)
                      .next("fewer poses or a simpler bias, or a larger cpu_s in the server file"));
  }
  const bool gets_on = time >= time_at_last_tick_ + kAnyTime || time_at_last_tick_ < 0;
  time_at_last_tick_ = time;
  const ChildProcess::State state = gets_on ? ChildProcess::State::kRuns : child_->state();
  ticks_still_ = state == ChildProcess::State::kRuns ? 0 : ticks_still_ + 1;
  if (ticks_still_ < (state == ChildProcess::State::kWaitsForDisk ? kTicksForDisk : kTicksStill))
    return {};
  return broken(Breakdown::Kind::kHung,
                failure(ErrorCode::kInternal,
                        "its computing hung: it did not use the processor, nor ask for it"));
}

void ComputeProcess::read_words() {
  std::array<char, 4096> buffer;
  while (true) {
    const ssize_t n = ::read(child_->words(), buffer.data(), buffer.size());
    if (n <= 0) {
      if (n == 0) child_->close_words();
      return;
    }
    words_.append(buffer.data(), static_cast<std::size_t>(n));
    if (words_.size() > 2 * kWordsKept) words_.erase(0, words_.size() - kWordsKept);
  }
}

Status ComputeProcess::receive() {
  std::array<char, 65536> buffer;
  const ssize_t n = ::recv(child_->channel(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return {};
  if (n <= 0) return crashed();
  reader_.feed({buffer.data(), static_cast<std::size_t>(n)});
  return {};
}

Failure ComputeProcess::broken(Breakdown::Kind kind, Failure why) {
  child_->kill();
  breakdown_ = Breakdown{kind, why.value()};
  return why;
}

Failure ComputeProcess::crashed() {
  // It has closed its end of the socket, so it is over in a moment; one that is not has lost its
  // mind.
  pollfd end{child_->end(), POLLIN, 0};
  ::poll(&end, 1, static_cast<int>(kTick.count()));
  if (child_->words() >= 0) read_words();
  const auto ending = child_->ending();
  const std::string how = ending ? "was ended by " + *ending : "stopped to answer";
  const std::string said = last_words(words_);
  return broken(Breakdown::Kind::kCrashed,
                failure(ErrorCode::kInternal, "the process that computed it {}{}", how,
                        said.empty() ? "" : ": " + said));
}

Result<std::unique_ptr<Computing>> start_computing(const ComputeOptions& options, ComputeTask task,
                                                   const StopRequests& stop) {
  if (options.program.empty())
    return std::unique_ptr<Computing>(std::make_unique<Workbench>(std::move(task), options.reads));
  return ComputeProcess::start(options, task, stop)
      .map([](std::unique_ptr<ComputeProcess> process) {
        return std::unique_ptr<Computing>(std::move(process));
      });
}

}  // namespace trammel
