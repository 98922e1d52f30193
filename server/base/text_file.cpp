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

Status write_text_file(const std::string& path, const std::string& text) {
  const std::string beside = fmt::format("{}.{}.part", path, ::getpid());
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    out << text;
    out.flush();
    if (!out) {
      const std::string why = std::strerror(errno);
      std::error_code ignored;
      fs::remove(beside, ignored);
      return refused("{}: cannot be written: {}", path, why);
    }
  }
  std::error_code error;
  fs::rename(beside, path, error);
  if (error) {
    std::error_code ignored;
    fs::remove(beside, ignored);
    return refused("{}: cannot be written: {}", path, error.message());
  }
  return {};
}

}  // namespace trammel
