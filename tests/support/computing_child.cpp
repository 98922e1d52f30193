#include "tests/support/computing_child.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "server/trainer/compute/compute_main.h"
#include "tests/support/daemon.h"

namespace trammel::test {

namespace {

std::string text_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool is_number(const std::string& name) {
  return !name.empty() &&
         std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

pid_t parent_of(const std::string& pid) {
  const std::string stat = text_of("/proc/" + pid + "/stat");
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos) return -1;
  std::istringstream rest(stat.substr(name_end + 1));
  std::string state;
  pid_t parent = -1;
  rest >> state >> parent;
  return state == "Z" ? -1 : parent;
}

}  // namespace

std::vector<std::string> compute_program() { return {trammeld_path(), kComputeWord}; }

std::optional<pid_t> computing_child(pid_t parent) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string pid = entry.path().filename();
    if (!is_number(pid) || parent_of(pid) != parent) continue;
    const std::string word = std::string(1, '\0') + kComputeWord + '\0';
    if (text_of("/proc/" + pid + "/cmdline").find(word) != std::string::npos) return std::stoi(pid);
  }
  return std::nullopt;
}

Watched::Watched(pid_t pid)
    : pid_(pid), pidfd_(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0))) {}

Watched::~Watched() {
  if (pidfd_ >= 0) ::close(pidfd_);
}

bool Watched::ends(std::chrono::milliseconds limit) const {
  if (pidfd_ < 0) return true;
  pollfd over{pidfd_, POLLIN, 0};
  return ::poll(&over, 1, static_cast<int>(limit.count())) == 1;
}

std::string Watched::status(const std::string& key) const {
  std::istringstream lines(text_of(fmt::format("/proc/{}/status", pid_)));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(key + ":\t")) return line.substr(key.size() + 2);
  }
  return "";
}

std::vector<int> Watched::descriptors() const {
  std::vector<int> numbers;
  std::error_code gone;
  for (const auto& entry :
       std::filesystem::directory_iterator(fmt::format("/proc/{}/fd", pid_), gone))
    numbers.push_back(std::stoi(entry.path().filename()));
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace trammel::test
