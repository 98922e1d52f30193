#include "server/base/text_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

namespace trammel {

namespace fs = std::filesystem;

Result<std::string> read_text_file(const std::string& path, std::size_t limit_bytes) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) && !fs::is_fifo(path, error) && !fs::is_character_file(path, error)) {
    return refused("{}: no such file", path);
  }
  if (fs::is_regular_file(path, error) && fs::file_size(path, error) > limit_bytes) {
    return failure(ErrorCode::kTooLarge, "{}: {} bytes, limit {}", path, fs::file_size(path, error), limit_bytes);
  }
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) return refused("{}: cannot be read: {}", path, std::strerror(errno));
  return std::move(text).str();
}

namespace {

/// Empty when all of it was written, else why not.
std::string write_all(const fs::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out << text;
  out.flush();
  return out ? "" : std::strerror(errno);
}

}  // namespace

Status write_text_file(const std::string& path, const std::string& text) {
  std::error_code error;
  // Renaming onto a device, a pipe or a link would put a file in its place.
  if (fs::exists(path, error) && !fs::is_regular_file(path, error)) {
    const std::string why = write_all(path, text);
    return why.empty() ? Status() : refused("{}: cannot be written: {}", path, why);
  }
  const fs::path target = fs::is_symlink(path, error) ? fs::weakly_canonical(path, error) : fs::path(path);
  const fs::path beside = fmt::format("{}.{}.part", target.string(), ::getpid());
  std::string why = write_all(beside, text);
  if (why.empty()) {
    fs::rename(beside, target, error);
    if (!error) return {};
    why = error.message();
  }
  fs::remove(beside, error);
  return refused("{}: cannot be written: {}", path, why);
}

}  // namespace trammel
