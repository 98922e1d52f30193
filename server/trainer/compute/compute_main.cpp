#include "server/trainer/compute/compute_main.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstring>
#include <new>
#include <optional>
#include <string_view>

#include "server/trainer/compute/child_process.h"
#include "server/trainer/compute/messages.h"
#include "server/trainer/compute/workbench.h"

namespace trammel {

namespace {

constexpr int kNiceness =
    10;  // a tenth of an equal share beside the service, all of an idle processor
constexpr rlim_t kTimeBeyond =
    60;  // s after the limit of processor time: the service ends it before that
constexpr std::chrono::milliseconds kReportInterval{50};
constexpr int kParentIsGone = 1;  // exit code where the other end is

void write_to(const char* path, std::string_view text) {
  const int file = ::open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0) return;  // this kernel has none
  static_cast<void>(::write(file, text.data(), text.size()));
  ::close(file);
}

/// Lowers the priorities as far as the host allows; a refusal leaves this process equal to others.
void step_back() {
  const sched_param batch{};
  ::sched_setscheduler(0, SCHED_BATCH, &batch);
  ::setpriority(PRIO_PROCESS, 0, kNiceness);
  write_to("/proc/self/oom_score_adj", "1000");
}

void limit_resources(rlim_t memory_bytes, rlim_t processor_s) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // these map terabytes
  const rlimit memory{memory_bytes, memory_bytes};
  ::setrlimit(RLIMIT_DATA, &memory);
#else
  static_cast<void>(memory_bytes);
#endif
  const rlimit time{processor_s + kTimeBeyond, processor_s + kTimeBeyond};
  ::setrlimit(RLIMIT_CPU, &time);
}

std::optional<long> number(const std::string& text) {
  long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

/// The answers to one task.
class Answers {
 public:
  explicit Answers(int channel) : channel_(channel) {}

  /// Until the other end is closed.
  void give() {
    while (const auto frame = received()) {
      try {
        answer(*frame);
      } catch (const std::bad_alloc&) {
        bench_.reset();
        send(message::of_error(
            failure(ErrorCode::kTooLarge, "it asks for more memory than there is").value(), true));
      } catch (const std::exception& error) {
        send(message::of_error(failure(ErrorCode::kInternal, "{}", error.what()).value(), false));
      }
    }
  }

 private:
  void answer(const Frame& frame) {
    const std::string kind = message::kind_of(frame);
    if (kind == "cell") texts_.cell = frame.text;
    if (kind == "robot") texts_.robot = frame.text;
    if (kind == "in_force") texts_.in_force = message::to_model_text(frame);
    if (kind == "task") begin(frame);
    if (kind == "batch") take(frame);
    if (kind == "make") make();
    if (kind == "opponent") opponents_.in_force = message::to_model_text(frame);
    if (kind == "served_before") opponents_.served_before.push_back(message::to_model_text(frame));
    if (kind == "judge") judge(frame);
  }

  void begin(const Frame& frame) {
    auto task = message::to_task(frame, std::move(texts_));
    if (task) {
      bench_.emplace(std::move(*task));
    } else {
      refused_ = task.error();
    }
  }

  void take(const Frame& frame) {
    bool judges = false;
    const BatchText batch = message::to_batch(frame, judges);
    if (!bench_ || refused_) return;
    if (const Status taken = bench_->take(batch, judges); !taken) refused_ = taken.error();
  }

  void make() {
    if (refused_) return send(message::of_error(*refused_, false));
    ComputeWatch watch;
    watch.progress = [this](const std::string& stage, double share) {
      report(stage, share);
      return true;
    };
    watch.found = [this](const std::string& findings, const std::string& page) {
      send(message::of_findings(findings, page));
      return Status();
    };
    const auto made = bench_.value().make(watch);
    send(made ? message::of_made(*made) : message::of_error(made.error(), false));
  }

  void judge(const Frame& frame) {
    message::read_opponents(frame, opponents_);
    const auto verdict = bench_.value().judge(std::exchange(opponents_, {}));
    send(verdict ? message::of_verdict(*verdict) : message::of_error(verdict.error(), false));
  }

  void report(const std::string& stage, double share) {
    const auto time = std::chrono::steady_clock::now();
    if (time < reported_ + kReportInterval) return;
    reported_ = time;
    send(message::of_progress(stage, share));
  }

  void send(const Frame& frame) const {
    const std::string bytes = encoded(frame);
    for (std::size_t sent = 0; sent < bytes.size();) {
      const ssize_t n = ::send(channel_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) ::_exit(kParentIsGone);
      sent += static_cast<std::size_t>(n);
    }
  }

  std::optional<Frame> received() {
    std::array<char, 65536> buffer;
    while (true) {
      auto frame = reader_.next();
      if (!frame) ::_exit(kParentIsGone);
      if (*frame) return std::move(**frame);
      const ssize_t n = ::recv(channel_, buffer.data(), buffer.size(), 0);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return std::nullopt;
      reader_.feed({buffer.data(), static_cast<std::size_t>(n)});
    }
  }

  const int channel_;
  FrameReader reader_;
  message::TaskTexts texts_;
  std::optional<Workbench> bench_;
  std::optional<Error> refused_;  // why the task cannot be begun
  Opponents opponents_;           // as far as they have arrived
  std::chrono::steady_clock::time_point reported_;
};

}  // namespace

int compute_main(const std::vector<std::string>& arguments) {
  constexpr int kUsage = 2;
  if (arguments.size() != 3) return kUsage;
  const auto parent = number(arguments[0]), memory_mb = number(arguments[1]),
             processor_s = number(arguments[2]);
  if (!parent || !memory_mb || !processor_s) return kUsage;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != *parent) return kParentIsGone;  // it was gone before that was set
  step_back();
  limit_resources(static_cast<rlim_t>(*memory_mb) << 20, static_cast<rlim_t>(*processor_s));
  Answers(ChildProcess::kChannel).give();
  return 0;
}

}  // namespace trammel
