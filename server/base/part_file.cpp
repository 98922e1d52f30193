#include "server/base/part_file.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <system_error>

namespace trammel {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::minutes kUntouched{1};

/// The process that writes `NAME.1234.part`; 0: it is no such file.
pid_t owner_of(const fs::path& part) {
  if (part.extension() != ".part") return 0;
  const std::string number = part.stem().extension().string();
  const bool digits =
      number.size() > 1 && std::all_of(number.begin() + 1, number.end(),
                                       [](unsigned char c) { return c >= '0' && c <= '9'; });
  return digits && number.size() < 9 ? static_cast<pid_t>(std::stol(number.substr(1))) : 0;
}

bool is_leftover(const fs::path& part) {
  const pid_t owner = owner_of(part);
  return owner > 0 && ::kill(owner, 0) != 0 && errno == ESRCH;
}

bool is_untouched(const fs::path& part) {
  std::error_code error;
  const auto written = fs::last_write_time(part, error);
  return !error && fs::file_time_type::clock::now() - written > kUntouched;
}

}  // namespace

fs::path part_beside(const fs::path& file) {
  return fmt::format("{}.{}.part", file.string(), ::getpid());
}

std::vector<fs::path> leftover_parts(const fs::path& folder) {
  std::vector<fs::path> left;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (is_leftover(it->path())) left.push_back(it->path());
  }
  std::sort(left.begin(), left.end());
  return left;
}

void remove_leftover_parts(const fs::path& file) {
  const fs::path folder = file.parent_path();
  std::error_code error;
  for (const fs::path& part : leftover_parts(folder.empty() ? "." : folder)) {
    const bool is_of_this = part.stem().stem() == file.filename();
    if (is_of_this && is_untouched(part)) fs::remove(part, error);
  }
}

}  // namespace trammel
