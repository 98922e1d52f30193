#include "server/store/store_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace trammel {
namespace {

constexpr std::size_t kSqliteHeader =
    100;  // length of the header of an SQLite file: sizes, counters, application id

bool is_same_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

bool is_untouched(const struct stat& a, const struct stat& b) {
  return a.st_size == b.st_size && a.st_ctim.tv_sec == b.st_ctim.tv_sec &&
         a.st_ctim.tv_nsec == b.st_ctim.tv_nsec;
}

/// Opens for writing: a copy-on-write file system then makes the copy now.
int open_file(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  return descriptor >= 0 ? descriptor : ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
}

}  // namespace

StoreFile::~StoreFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

StoreFile::StoreFile(StoreFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      left_(std::move(other.left_)) {}

Status StoreFile::hold() {
  struct stat there {};
  struct stat held {};
  if (::stat(path_.c_str(), &there) != 0 || !S_ISREG(there.st_mode)) return {};
  if (descriptor_ >= 0 && ::fstat(descriptor_, &held) == 0 && is_same_file(there, held)) return {};
  const int descriptor = open_file(path_);
  if (descriptor < 0) return {};  // the next program that opens it reports the reason
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(descriptor);
    return failure(ErrorCode::kConflict, "another process is writing it, by this name or another")
        .in(path_)
        .next("one writer at a time");
  }
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = descriptor;
  return {};
}

StoreFile::Left StoreFile::now(const struct stat& about) const {
  Left left{about, std::string(kSqliteHeader, '\0'), 0};
  const ssize_t read =
      descriptor_ >= 0 ? ::pread(descriptor_, left.header.data(), kSqliteHeader, 0) : 0;
  left.header.resize(read > 0 ? static_cast<std::size_t>(read) : 0);
  struct stat journal {};
  if (::stat((path_ + "-wal").c_str(), &journal) == 0) left.journal = journal.st_ino;
  return left;
}

void StoreFile::remember() {
  struct stat about {};
  const bool known =
      descriptor_ >= 0 ? ::fstat(descriptor_, &about) == 0 : ::stat(path_.c_str(), &about) == 0;
  if (known) left_ = now(about);
}

StoreFile::Finding StoreFile::look() const {
  struct stat about {};
  if (!left_) return Finding::kTouched;
  if (::stat(path_.c_str(), &about) != 0) return Finding::kGone;
  if (!is_same_file(about, left_->about)) return Finding::kAnother;
  const Left present = now(about);
  const bool as_left = is_untouched(about, left_->about) && present.header == left_->header &&
                       (left_->journal == 0 || present.journal == left_->journal);
  return as_left ? Finding::kAsLeft : Finding::kTouched;
}

std::string StoreFile::how_to_bring_back() const {
  return descriptor_ < 0 ? ""
                         : fmt::format("cp /proc/{}/fd/{} '{}'", ::getpid(), descriptor_, path_);
}

}  // namespace trammel
