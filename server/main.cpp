// trammeld: creates the parts of the server, connects and runs them, and stops them in reverse order.
#include <fcntl.h>
#include <signal.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/line_output.h"
#include "server/base/memory.h"
#include "server/base/mutex.h"
#include "server/base/plain_text.h"
#include "server/config/server_config.h"
#include "server/config/start_check.h"
#include "server/dds/dds_service.h"
#include "server/dds/port_lock.h"
#include "server/dds/watchdog.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/compute/compute_main.h"
#include "server/trainer/trainer.h"

namespace trammel {
namespace {

constexpr int kExitUsage = 2;
constexpr int kExitRefused = 3;
constexpr int kExitUnreachable = 4;

struct Arguments {
  std::string config;
  bool check = false;
  std::optional<std::string> store;
  std::optional<std::uint16_t> port;
  std::optional<std::uint32_t> domain;
};

int exit_code(const Error& error) {
  switch (error.code) {
    case ErrorCode::kUsage:
      return kExitUsage;
    case ErrorCode::kBusy:
    case ErrorCode::kUnreachable:
      return kExitUnreachable;
    default:
      return kExitRefused;
  }
}

/// Prints one line for each error.
int refuse(const Error& error) {
  LineOutput said(STDERR_FILENO);
  for (const Error& one : apart(error)) said.write(fmt::format("trammeld: {}\n", sentence(one)));
  return exit_code(error);
}

/// Prints the problems of a start that would fail.
int refuse_start(std::vector<Error> problems) {
  Error all = together(std::move(problems));
  all.code = ErrorCode::kRefused;
  return refuse(all);
}

/// Prints what a start would meet on this host.
int check(const ServerReading& server, const std::string& path) {
  const StartCheck found = check_start(server, path);
  for (const std::string& note : found.notes) fmt::print("{}\n", shown(note));
  if (!found.problems.empty()) return refuse_start(found.problems);
  fmt::print("{}: good, {} cells\n", path, server.config.cells.size());
  return 0;
}

/// The message in one line that controls no terminal, whatever names it holds.
class PlainMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& line) override {
    const std::string plain = shown({message.payload.data(), message.payload.size()});
    line.append(plain.data(), plain.data() + plain.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PlainMessage>();
  }
};

/// Lines of the log to where nobody may read any more: the service does not wait for that.
class LogSink final : public spdlog::sinks::sink {
 public:
  explicit LogSink(int descriptor) : output_(descriptor), is_terminal_(::isatty(descriptor) == 1) {}

  void log(const spdlog::details::log_msg& message) override {
    const MutexLock lock(mutex_);
    message.color_range_start = message.color_range_end = 0;
    spdlog::memory_buf_t formatted;
    formatter_->format(message, formatted);
    std::string line = fmt::to_string(formatted);
    if (is_terminal_ && message.color_range_end > message.color_range_start) {
      line.insert(message.color_range_end, "\033[m");
      line.insert(message.color_range_start, color_of(message.level));
    }
    output_.write(line);
  }
  void flush() override {}
  void set_pattern(const std::string& pattern) override {
    set_formatter(std::make_unique<spdlog::pattern_formatter>(pattern));
  }
  void set_formatter(std::unique_ptr<spdlog::formatter> formatter) override {
    const MutexLock lock(mutex_);
    formatter_ = std::move(formatter);
  }

 private:
  static const char* color_of(spdlog::level::level_enum level) {
    if (level >= spdlog::level::err) return "\033[31m\033[1m";
    if (level == spdlog::level::warn) return "\033[33m\033[1m";
    return level == spdlog::level::info ? "\033[32m" : "\033[36m";
  }

  LineOutput output_;
  const bool is_terminal_;
  Mutex mutex_;
  std::unique_ptr<spdlog::formatter> formatter_ TRAMMEL_GUARDED_BY(mutex_) =
      std::make_unique<spdlog::pattern_formatter>();
};

Status start_log(const LogOptions& options) {
  int descriptor = STDERR_FILENO;
  if (!options.file.empty()) {
    descriptor = ::open(options.file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NONBLOCK | O_NOCTTY | O_CLOEXEC, 0644);
    if (descriptor < 0)
      return refused("cannot be opened: {}", std::strerror(errno)).in(options.file).under("log: file");
  }
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("trammeld", std::make_shared<LogSink>(descriptor)));
  spdlog::set_error_handler([](const std::string&) {});  // it would wait for standard error
  spdlog::set_level(spdlog::level::from_str(options.level));
  spdlog::flush_on(spdlog::level::info);
  auto line = std::make_unique<spdlog::pattern_formatter>();
  line->add_flag<PlainMessage>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %*");
  spdlog::set_formatter(std::move(line));
  return {};
}

void log_progress(const JobProgress& progress) {
  switch (progress.stage) {
    case JobStage::kQueued:
      if (progress.what.empty()) {
        spdlog::info("{}: job {} is queued", progress.cell, progress.job);
      } else {
        spdlog::warn("{}: job {} is queued: {}", progress.cell, progress.job, progress.what);
      }
      break;
    case JobStage::kTraining:
      spdlog::debug("{}: job {}: {}, {:.0f} %", progress.cell, progress.job, progress.what, 100 * progress.share);
      break;
    case JobStage::kStoring:
      spdlog::debug("{}: job {} is being stored", progress.cell, progress.job);
      break;
    case JobStage::kDone:
      if (progress.model_version == 0) {
        spdlog::info("{}: job {} is done: {}", progress.cell, progress.job, progress.what);
      } else {
        spdlog::info("{}: job {} made version {}, {}", progress.cell, progress.job, progress.model_version,
                     progress.what);
      }
      break;
    case JobStage::kFailed:
      spdlog::warn("{}: job {} failed: {}", progress.cell, progress.job, progress.what);
      break;
  }
}

/// Whoever asks for nonsense all day does not fill the log of a service that logs what happens.
void log_call(const CallReport& call) {
  const std::string trace = call.trace.empty() ? "" : fmt::format(" (trace {})", call.trace);
  if (!call.refused.empty()) {
    spdlog::debug("{}: {} of request {}{} is refused: {}", call.cell, call.operation, call.request, trace,
                  call.refused);
  } else {
    spdlog::info("{}: {} of request {}{} is done", call.cell, call.operation, call.request, trace);
  }
}

/// Takes the signals that end the service in a thread of its own; all other threads block them. A signal ends the
/// process within kOrderlyStop, even if another thread hangs.
class StopSignals {
 public:
  StopSignals() {
    ::sigemptyset(&signals_);
    ::sigaddset(&signals_, SIGTERM);
    ::sigaddset(&signals_, SIGINT);
    ::pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    thread_ = std::jthread([this](const std::stop_token& over) { take(over); });
  }
  ~StopSignals() {
    thread_.request_stop();
    ::pthread_kill(thread_.native_handle(), SIGTERM);
  }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Waits for the first signal.
  [[nodiscard]] const char* wait() {
    MutexLock lock(mutex_);
    came_.wait(lock, [this]() TRAMMEL_REQUIRES(mutex_) { return number_ != 0; });
    return ::strsignal(number_);
  }

 private:
  static constexpr std::chrono::milliseconds kOrderlyStop{10'000};
  static constexpr std::chrono::milliseconds kTick{250};

  void take(const std::stop_token& over) {
    ::pthread_setname_np(::pthread_self(), "signals");
    int number = 0;
    while (::sigwait(&signals_, &number) != 0) continue;
    if (over.stop_requested()) return;
    {
      const MutexLock lock(mutex_);
      number_ = number;
    }
    came_.notify_all();
    // Counts ticks, not time: the process may be paused meanwhile, and that is no hang.
    const timespec tick{0, std::chrono::nanoseconds(kTick).count()};
    for (auto waited = kTick; waited <= kOrderlyStop; waited += kTick) {
      ::sigtimedwait(&signals_, nullptr, &tick);
      if (over.stop_requested()) return;
    }
    end_at_once("trammeld: hangs: was asked to stop and has not stopped after 10 s; ends at once\n");
  }

  sigset_t signals_;
  Mutex mutex_;
  Condition came_;
  int number_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::jthread thread_;
};

/// What would end the process though it can go on: a pipe that nobody reads any more, a file that may grow no further.
/// Both are errors of the call that met them. The processes that compute get the signals as they were.
void ignore_what_calls_report() {
  for (const int number : {SIGPIPE, SIGXFSZ}) {
    struct sigaction ignored {};
    ignored.sa_handler = SIG_IGN;
    ::sigaction(number, &ignored, nullptr);
  }
}

/// Serves until a signal ends it.
Status serve(const ServerConfig& config) {
  StopSignals signals;  // before any thread starts
  auto store = Store::open(config.store);
  if (!store) return tl::make_unexpected(store.error());
  ModelRegistry registry(config.models_in_memory);
  Trainer trainer(config.cells, **store, registry, config.trainer);
  DdsService service(config.dds, trainer, **store, registry);
  service.set_call_listener(log_call);
  service.set_packet_listener([](const std::string& dropped) { spdlog::warn("{}", dropped); });
  trainer.set_listeners(
      [&service](const JobProgress& progress) {
        log_progress(progress);
        service.publish_progress(progress);
      },
      [&service](const ServedModel& model, bool in_force) {
        if (!in_force) return;
        spdlog::info("{}: version {} ({}) is in force", model.cell, model.version, model.model.provenance().id);
        service.publish_model(model.cell);
      },
      [](const std::string& trouble, bool over) {
        if (over) return spdlog::info("over: {}", trouble);
        spdlog::warn("{}", trouble);
      });

  const auto notices = trainer.take_up();
  if (!notices) return tl::make_unexpected(notices.error());
  for (const std::string& notice : *notices) spdlog::warn("{}", notice);
  // A second copy of this server is told about the port first.
  const Status free = PortLock::take(config.dds.address, config.dds.port).map([](const PortLock&) {});
  if (!free) return free;
  const auto name = PortLock::take_name(config.dds.domain, config.dds.server_id);
  if (!name) return tl::make_unexpected(name.error());
  if (const Status started = service.start(); !started) return started;
  if (const auto started = trainer.start(); !started) return tl::make_unexpected(started.error());
  spdlog::info("ready: {} serves {} cells on {}:{}, domain {}, store {}", config.dds.server_id, config.cells.size(),
               config.dds.address, config.dds.port, config.dds.domain, config.store);

  spdlog::info("stopping: {}", signals.wait());
  service.stop();
  trainer.stop();
  spdlog::info("stopped");
  return {};
}

int run(const Arguments& arguments) {
  ServerReading server = read_server(arguments.config);
  ServerConfig& config = server.config;
  config.trainer.compute.program = {"/proc/self/exe", kComputeWord};  // this very file, also where it was replaced
  if (arguments.store) config.store = *arguments.store;
  if (arguments.port) config.dds.port = *arguments.port;
  if (arguments.domain) config.dds.domain = *arguments.domain;
  if (arguments.check) return check(server, arguments.config);
  if (!server.problems.empty()) return refuse_start(server.problems);
  if (auto log = start_log(config.log); !log) return refuse(log.error());
  const Status served = serve(config);
  if (served) return 0;
  if (!config.log.file.empty()) spdlog::error("{}", sentence(served.error()));
  return refuse(served.error());
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == trammel::kComputeWord)
    return trammel::compute_main({argv + 2, argv + argc});
  CLI::App app("Serves compensated robot models over DDS, and trains new ones. Runs until SIGTERM or SIGINT.",
               "trammeld");
  app.footer(
      "Exit codes: 0 stopped by a signal, or checked and good; 2 wrong usage, or an address that this host does not\n"
      "have; 3 a file, the store or the port is refused; 70 the process hung and ended itself (start it again:\n"
      "deploy/supervise does). Each problem is a line of its own on standard error.");
  trammel::Arguments arguments;
  app.add_option("--config", arguments.config, "Server file (YAML); config/server.yaml has every key with its default")
      ->required();
  app.add_flag("--check", arguments.check,
               "Only say all that a start or a first training would refuse, and change nothing");
  app.add_option("--store", arguments.store, "Store (SQLite file) instead of the server file's");
  app.add_option("--port", arguments.port, "UDP port where clients look for it, instead of the server file's")
      ->check(CLI::Range(1024, 65535));
  app.add_option("--domain", arguments.domain, "DDS domain instead of the server file's")->check(CLI::Range(0, 232));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : trammel::kExitUsage;
  }
  trammel::ignore_what_calls_report();
  trammel::give_large_blocks_back();
  return trammel::run(arguments);
}
