#include "server/base/text_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "server/base/part_file.h"
#include "server/base/plain_text.h"
#include "server/base/unix_time.h"

namespace trammel {

namespace fs = std::filesystem;

namespace {

/// Reads without knowing the size: a pipe or a device has none.
Result<std::string> read_up_to(const std::string& path, std::size_t limit_bytes) {
  std::ifstream in(path, std::ios::binary);
  std::string text;
  std::vector<char> part(std::size_t{1} << 16);
  while (in.read(part.data(), static_cast<std::streamsize>(part.size())) || in.gcount() > 0) {
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
    if (text.size() > limit_bytes) {
      return failure(ErrorCode::kTooLarge, "more than {} bytes, its limit", limit_bytes)
          .in(path)
          .beyond(text.size(), limit_bytes);
    }
  }
  if (!in.eof()) return refused("cannot be read: {}", std::strerror(errno)).in(path);
  return text;
}

}  // namespace

Result<std::string> read_text_file(const std::string& path, std::size_t limit_bytes) {
  std::error_code error;
  if (fs::is_directory(path, error))
    return refused("a folder, expected a file").in(path).next("name a file in it");
  if (!fs::is_regular_file(path, error) && !fs::is_fifo(path, error) &&
      !fs::is_character_file(path, error)) {
    return refused("no such file").in(path);
  }
  if (fs::is_regular_file(path, error) && fs::file_size(path, error) > limit_bytes) {
    const std::uintmax_t bytes = fs::file_size(path, error);
    return failure(ErrorCode::kTooLarge, "{} bytes, limit {}", bytes, limit_bytes)
        .in(path)
        .beyond(bytes, limit_bytes);
  }
  return read_up_to(path, limit_bytes);
}

std::int64_t written_at(const std::string& path) {
  struct stat about {};
  const bool is_file = ::stat(path.c_str(), &about) == 0 && S_ISREG(about.st_mode);
  return is_file ? static_cast<std::int64_t>(about.st_mtime) : unix_now();
}

namespace {

/// Writes all of `text`; returns the reason of a failure, or an empty text.
std::string write_all(const fs::path& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out << text;
  out.flush();
  return out ? "" : std::strerror(errno);
}

/// Devices, pipes and links are written in place: a rename would replace them by a file.
bool is_written_in_place(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error) && !fs::is_regular_file(path, error);
}

fs::path target_of(const std::string& path) {
  std::error_code error;
  return fs::is_symlink(path, error) ? fs::weakly_canonical(path, error) : fs::path(path);
}

fs::path beside(const std::string& path) { return part_beside(target_of(path)); }

/// A TextFile that is not copied: a text may take tens of megabytes.
struct FileView {
  const std::string& path;
  const std::string& text;
};

void remove_parts(const std::vector<FileView>& files) {
  std::error_code error;
  for (const FileView& file : files) {
    if (!is_written_in_place(file.path)) fs::remove(beside(file.path), error);
  }
}

/// The advice for a file that cannot be written.
std::string other_place(const std::string& path) {
  std::error_code error;
  const fs::path folder = fs::path(path).parent_path();
  if (fs::is_directory(path, error)) return "name a file in it";
  if (!folder.empty() && !fs::exists(folder, error))
    return fmt::format("make the folder first: mkdir -p {}", shown(folder.string()));
  return "name a file that you may write, in a folder with room";
}

/// `done`: files that were renamed before, each after a blank.
Failure cannot_be_written(const std::string& path, const std::string& why,
                          const std::string& done = "") {
  return refused("cannot be written: {}", why)
      .in(path)
      .next(done.empty() ? other_place(path) : "already written:" + done);
}

Status write_views(const std::vector<FileView>& files) {
  for (const FileView& file : files) {
    if (is_written_in_place(file.path)) continue;
    if (const std::string why = write_all(beside(file.path), file.text); !why.empty()) {
      remove_parts(files);
      return cannot_be_written(file.path, why);
    }
  }
  std::string done;
  for (const FileView& file : files) {
    std::string why;
    if (is_written_in_place(file.path)) {
      why = write_all(file.path, file.text);
    } else {
      std::error_code error;
      fs::rename(beside(file.path), target_of(file.path), error);
      if (error) why = error.message();
    }
    if (!why.empty()) {
      remove_parts(files);
      return cannot_be_written(file.path, why, done);
    }
    done += " " + file.path;
  }
  return {};
}

}  // namespace

Status write_text_file(const std::string& path, const std::string& text) {
  const Status written = write_views({{path, text}});
  if (written && !is_written_in_place(path)) remove_leftover_parts(target_of(path));
  return written;
}

Status write_text_files(const std::vector<TextFile>& files) {
  std::vector<FileView> views;
  for (const TextFile& file : files) views.push_back({file.path, file.text});
  return write_views(views);
}

Status check_writable(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return cannot_be_written(path, "it is a folder");
  const bool exists = fs::exists(path, error);
  if (exists && ::access(path.c_str(), W_OK) != 0)
    return cannot_be_written(path, std::strerror(errno));
  if (is_written_in_place(path)) return {};
  const fs::path parent = target_of(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    return cannot_be_written(path, std::strerror(errno));
  if (!fs::is_directory(folder, error)) return cannot_be_written(path, folder + " is no folder");
  return {};
}

}  // namespace trammel
