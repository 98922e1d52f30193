#include "server/store/writer_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "server/store/store_file.h"

namespace trammel {
namespace {

std::string holder_of(int descriptor) {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(descriptor, text.data(), text.size() - 1, 0);
  const std::string pid(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
  return pid.substr(0, pid.find('\n'));
}

std::string lock_path_of(const std::string& file) {
  std::error_code unknown;
  const auto real = std::filesystem::weakly_canonical(file, unknown);
  return (unknown ? file : real.string()) + ".lock";
}

Failure held(const std::string& file, int descriptor, const std::string& lock) {
  return failure(ErrorCode::kConflict, "process {} is writing it (lock {})", holder_of(descriptor),
                 lock)
      .in(file)
      .next("one writer at a time");
}

}  // namespace

Status WriterLock::look(const std::string& file) {
  TRY(StoreFile(file).hold());
  const std::string path = lock_path_of(file);
  const WriterLock lock(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (lock.descriptor_ < 0) {
    if (errno == ENOENT) return {};
    return failure(ErrorCode::kInternal, "cannot be opened: {}", std::strerror(errno)).in(path);
  }
  if (::flock(lock.descriptor_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return {};
  return held(file, lock.descriptor_, path);
}

Result<WriterLock> WriterLock::take(const std::string& file) {
  const std::string path = lock_path_of(file);
  int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  const std::string why = std::strerror(errno);
  const bool writable = descriptor >= 0;
  // On a disk that cannot be written: the lock file as it is, or the file itself.
  if (descriptor < 0) descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return failure(ErrorCode::kInternal, "cannot be opened: {}", why).in(path);
  WriterLock lock(descriptor);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) {
      return failure(ErrorCode::kInternal, "cannot be locked: {}", std::strerror(errno)).in(path);
    }
    return held(file, descriptor, path);
  }
  // The holder's id is for people; on a full disk it is missing.
  const std::string pid = std::to_string(::getpid()) + "\n";
  if (writable)
    static_cast<void>(::ftruncate(descriptor, 0) == 0 &&
                      ::pwrite(descriptor, pid.data(), pid.size(), 0) > 0);
  return lock;
}

WriterLock::~WriterLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace trammel
