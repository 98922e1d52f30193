#include "server/store/new_store_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "server/base/part_file.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr const char* kElsewhere = "name a file that you may write, in a folder with room";

/// Removes the file in which a copy is being made; a complete copy has another name by then.
class Unfinished {
 public:
  explicit Unfinished(std::string path) : path_(std::move(path)) {}
  ~Unfinished() {
    std::error_code error;
    fs::remove(path_, error);
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

 private:
  const std::string path_;
};

Status on_disk(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool is_there = file >= 0 && ::fsync(file) == 0;
  const int why = errno;
  if (file >= 0) ::close(file);
  if (is_there) return {};
  return failure(ErrorCode::kInternal, "cannot be written to the disk: {}", std::strerror(why))
      .in(path)
      .next(kElsewhere);
}

Status check_is_new(const std::string& path) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(path, error))) return {};
  return refused("is there already").in(path).next("name another, or move it away");
}

}  // namespace

Status make_store_file(const std::string& path,
                       const std::function<Status(const std::string& part)>& make) {
  TRY(check_is_new(path));
  remove_leftover_parts(path);
  const std::string part = part_beside(path).string();
  const Unfinished unfinished(part);
  TRY(make(part));
  TRY(on_disk(part));
  if (::link(part.c_str(), path.c_str()) != 0)  // unlike a rename it replaces nothing
    return failure(ErrorCode::kRefused, "cannot be written: {}", std::strerror(errno))
        .in(path)
        .next(kElsewhere);
  const fs::path folder = fs::path(path).parent_path();
  return on_disk(folder.empty() ? "." : folder.string());
}

}  // namespace trammel
