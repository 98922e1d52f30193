#include "server/store/served_copies.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <optional>
#include <set>
#include <system_error>

#include "server/base/hash.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kVersionsKept = 3;
constexpr std::size_t kCellDigits =
    32;  // of the hash of its name, since a name may have characters that a file name must not
constexpr const char* kEnding = ".json";
constexpr const char* kPart = ".part";  // of a copy that is being written

/// The entries of the folder; empty where it cannot be read.
std::vector<fs::directory_entry> entries_of(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::directory_entry> entries;
  for (fs::directory_iterator at(folder, error); !error && at != fs::directory_iterator();
       at.increment(error))
    entries.push_back(*at);
  return entries;
}

/// Removes the part files of a server that was killed; nobody else writes copies there.
void remove_parts(const fs::path& folder) {
  std::error_code error;
  for (const fs::directory_entry& entry : entries_of(folder)) {
    if (entry.path().extension() == kPart) fs::remove(entry.path(), error);
  }
}

std::string name_of(std::int64_t activation, int version) {
  return fmt::format("{}.{}{}", activation, version, kEnding);
}

template <typename Number>
bool read_number(std::string_view& text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  if (error != std::errc{} || end == text.data() + text.size() || *end != '.') return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()) + 1);
  return true;
}

/// The copy that a file name stands for; empty: the name is not that of a copy.
std::optional<ServedCopies::Copy> copy_at(const fs::path& file) {
  const std::string name = file.filename().string();
  if (!name.ends_with(kEnding)) return std::nullopt;
  std::string_view rest(name);
  ServedCopies::Copy copy{0, 0, file.string()};
  if (!read_number(rest, &copy.activation) || !read_number(rest, &copy.version))
    return std::nullopt;
  return copy;
}

Failure cannot(const char* what, const std::string& path) {
  return failure(ErrorCode::kInternal, "cannot be {}: {}", what, std::strerror(errno)).in(path);
}

Status sync_folder(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return cannot("opened", path);
  const int failed = ::fsync(descriptor);
  ::close(descriptor);
  if (failed != 0) return cannot("written", path);
  return {};
}

Status write_part(const std::string& path, const std::string& content) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor < 0) return cannot("opened", path);
  std::string_view left(content);
  while (!left.empty()) {
    const ssize_t written = ::write(descriptor, left.data(), left.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) break;
    left.remove_prefix(static_cast<std::size_t>(written));
  }
  const bool fine = left.empty() && ::fsync(descriptor) == 0;
  const Status outcome = fine ? Status() : Status(cannot("written", path));
  ::close(descriptor);
  if (!fine) ::unlink(path.c_str());
  return outcome;
}

}  // namespace

std::string ServedCopies::folder() const {
  const MutexLock lock(mutex_);
  return store_.empty() || root_.empty() ? "" : root_ + "/" + store_;
}

std::vector<std::string> ServedCopies::stores() const {
  std::vector<std::pair<fs::file_time_type, std::string>> found;
  for (const fs::directory_entry& entry : entries_of(root_)) {
    std::error_code error;
    if (entry.is_directory(error))
      found.emplace_back(entry.last_write_time(error), entry.path().filename().string());
  }
  std::sort(found.rbegin(), found.rend());
  std::vector<std::string> stores;
  for (auto& [when, store] : found) stores.push_back(std::move(store));
  return stores;
}

Status ServedCopies::belong_to(const std::string& store, bool served) {
  {
    const MutexLock lock(mutex_);
    store_ = store;
  }
  std::error_code error;
  if (served && !root_.empty()) fs::create_directories(folder(), error);
  if (error)
    return failure(ErrorCode::kInternal, "cannot be created: {}", error.message()).in(folder());
  return {};
}

std::string ServedCopies::store() const {
  const MutexLock lock(mutex_);
  return store_;
}

std::string ServedCopies::folder(const std::string& cell) const {
  const std::string all = folder();
  return all.empty() ? "" : all + "/" + sha256_hex(cell).substr(0, kCellDigits);
}

std::vector<ServedCopies::Copy> ServedCopies::of(const std::string& cell) const {
  std::vector<Copy> copies;
  const std::string where = folder(cell);
  if (where.empty()) return copies;
  for (const fs::directory_entry& entry : entries_of(where)) {
    if (auto copy = copy_at(entry.path())) copies.push_back(std::move(*copy));
  }
  std::sort(copies.begin(), copies.end(),
            [](const Copy& a, const Copy& b) { return a.activation > b.activation; });
  return copies;
}

std::vector<std::string> ServedCopies::files_of(const std::string& cell, int version) const {
  std::vector<std::string> files;
  for (Copy& copy : of(cell)) {
    if (copy.version == version) files.push_back(std::move(copy.file));
  }
  return files;
}

Status ServedCopies::keep(const std::string& cell, std::int64_t activation, int version,
                          const std::string& content) const {
  const std::string where = folder(cell);
  if (where.empty()) return {};
  std::error_code error;
  const bool is_new = fs::create_directories(where, error);
  const std::string file = where + "/" + name_of(activation, version);
  const std::string part = file + kPart;
  remove_parts(where);
  TRY(write_part(part, content));
  fs::rename(part, file, error);
  if (error)
    return failure(ErrorCode::kInternal, "cannot be renamed: {}", error.message()).in(part);
  TRY(sync_folder(where));
  if (is_new) {
    TRY(sync_folder(folder()));
  }
  std::set<int> seen;
  for (const Copy& copy : of(cell)) {
    const bool newest_of_its_version = seen.insert(copy.version).second;
    if (!newest_of_its_version || seen.size() > kVersionsKept) fs::remove(copy.file, error);
  }
  return {};
}

void ServedCopies::forget_after(const std::string& cell, std::int64_t activation) const {
  std::error_code error;
  for (const Copy& copy : of(cell)) {
    if (copy.activation > activation) fs::remove(copy.file, error);
  }
}

}  // namespace trammel
