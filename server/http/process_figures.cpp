#include "server/http/process_figures.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>
#include <vector>

namespace trammel {
namespace {

namespace fs = std::filesystem;

/// Unix time, s, when this program file was loaded.
const double kStarted =
    std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();

/// The fields of /proc/self/stat behind the name of the process, which may hold anything.
std::vector<double> fields_of_stat() {
  std::ifstream in("/proc/self/stat");
  const std::string line{std::istreambuf_iterator<char>(in), {}};
  std::istringstream rest(
      line.substr(std::min(line.size(), line.rfind(')') + 4)));  // and its state
  return {std::istream_iterator<double>(rest), {}};
}

double size_of(const std::string& path) {
  std::error_code error;
  const auto bytes = fs::file_size(path, error);
  return error ? 0 : static_cast<double>(bytes);
}

}  // namespace

ProcessFigures process_figures() {
  // proc(5), counted from the fourth field.
  constexpr std::size_t kThreads = 16, kResidentPages = 20;
  ProcessFigures now;
  if (const std::vector<double> fields = fields_of_stat(); fields.size() > kResidentPages) {
    now.threads = fields[kThreads];
    now.resident_bytes = fields[kResidentPages] * static_cast<double>(::sysconf(_SC_PAGESIZE));
  }
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  now.processor_s = seconds(used.ru_utime) + seconds(used.ru_stime);
  now.started = kStarted;
  std::error_code error;
  for (fs::directory_iterator file("/proc/self/fd", error), end; !error && file != end;
       file.increment(error))
    ++now.open_files;
  return now;
}

StoreFileFigures store_file_figures(const std::string& path) {
  StoreFileFigures now{size_of(path), size_of(path + "-wal"), 0};
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  const fs::space_info space = fs::space(folder.empty() ? fs::path(".") : folder, error);
  if (!error) now.free_bytes = static_cast<double>(space.available);
  return now;
}

}  // namespace trammel
