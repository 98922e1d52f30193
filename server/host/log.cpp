#include "server/host/log.h"

#include <fcntl.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>

#include "server/base/line_output.h"
#include "server/base/mutex.h"
#include "server/base/plain_text.h"
#include "server/host/log_limit.h"

namespace trammel {
namespace {

/// The message in one line that controls no terminal, whatever names it holds.
class PlainMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& line) override {
    const std::string plain = shown({message.payload.data(), message.payload.size()});
    line.append(plain.data(), plain.data() + plain.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PlainMessage>();
  }
};

/// A sink for log lines whose reader may have stopped reading: the service does not wait for it.
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

/// The format of lines and the limits, beside the logger.
struct LogState {
  std::atomic<bool> json{false};
  Mutex mutex;
  LogLimit limit TRAMMEL_GUARDED_BY(mutex);
};

LogState& state() {
  static LogState log;
  return log;
}

spdlog::level::level_enum level_of(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarn:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

}  // namespace

Status start_log(const LogOptions& options) {
  int descriptor = STDERR_FILENO;
  if (!options.file.empty()) {
    descriptor = ::open(options.file.c_str(),
                        O_WRONLY | O_CREAT | O_APPEND | O_NONBLOCK | O_NOCTTY | O_CLOEXEC, 0644);
    if (descriptor < 0)
      return refused("cannot be opened: {}", std::strerror(errno))
          .in(options.file)
          .under("log: file");
  }
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("trammeld", std::make_shared<LogSink>(descriptor)));
  spdlog::set_error_handler([](const std::string&) {});  // the default handler would wait for
                                                         // standard error
  spdlog::flush_on(spdlog::level::info);
  change_log(options);
  return {};
}

void change_log(const LogOptions& options) {
  state().json = options.format == "json";
  spdlog::set_level(spdlog::level::from_str(options.level));
  auto line = std::make_unique<spdlog::pattern_formatter>();
  if (state().json) {
    line->set_pattern(R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})");
  } else {
    line->add_flag<PlainMessage>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %*");
  }
  spdlog::set_formatter(std::move(line));
}

std::string log_members(const char* kind, const std::string& text, const LogAbout& about) {
  nlohmann::ordered_json members = {{"event", kind}};
  for (const auto& [name, value] : about) {
    if (!value.empty()) members[name] = value;
  }
  members["message"] = text;
  const std::string object =
      members.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  return object.substr(1, object.size() - 2);
}

void tell(LogLevel level, const char* kind, const std::string& text, const LogAbout& about) {
  const auto spoken = level_of(level);
  if (!spdlog::should_log(spoken)) return;
  LogLimit::Verdict verdict;
  if (level != LogLevel::kDebug) {
    const MutexLock lock(state().mutex);
    verdict = state().limit.look(kind, std::chrono::steady_clock::now());
  }
  if (!verdict.goes) return;
  const auto write = [&](const std::string& what, const char* of_kind, const LogAbout& with) {
    spdlog::log(spoken, "{}", state().json ? log_members(of_kind, what, with) : what);
  };
  if (verdict.left_out_before > 0) {
    const std::string count = std::to_string(verdict.left_out_before);
    write(fmt::format("{} more of this kind were left out: {}", count, kind), "left_out",
          {{"of", kind}, {"count", count}});
  }
  write(text, kind, about);
}

}  // namespace trammel
