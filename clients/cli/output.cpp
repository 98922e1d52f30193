#include "clients/cli/output.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "server/base/text_file.h"

namespace trammel::cli {

Status write_output(const std::string& path, const std::string& text) {
  if (path != "-") return write_text_file(path, text);
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written) return refused("standard output: cannot be written: {}", std::strerror(errno));
  return {};
}

Status write_json(const std::string& path, const nlohmann::ordered_json& value) {
  if (path.empty()) return {};
  return write_output(path, value.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

void tell(const std::string& text, std::initializer_list<std::string> paths) {
  const auto is_standard_output = [](const std::string& path) { return path == "-" || path == "/dev/stdout"; };
  if (std::any_of(paths.begin(), paths.end(), is_standard_output)) return;
  std::fputs(text.c_str(), stdout);
}

ProgressLine::ProgressLine() : terminal_(::isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (!shown_.empty()) std::fputs("\r\033[K", stderr);
}

void ProgressLine::show(const std::string& what, double share) {
  if (!terminal_) return;
  const std::string line = fmt::format("{} {:.0f} %", what, 100 * std::clamp(share, 0.0, 1.0));
  if (line == shown_) return;
  fmt::print(stderr, "\r\033[K{}", line);
  std::fflush(stderr);
  shown_ = line;
}

}  // namespace trammel::cli
