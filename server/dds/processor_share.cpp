#include "server/dds/processor_share.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

namespace trammel {
namespace {

/// Closes its descriptor.
struct Opened {
  int descriptor;
  explicit Opened(const char* path, int flags = 0)
      : descriptor(::open(path, O_RDONLY | O_CLOEXEC | flags)) {}
  ~Opened() {
    if (descriptor >= 0) ::close(descriptor);
  }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;
};

/// Calls `use` with the name of each entry of a folder, including `.` and `..`. readdir() would
/// allocate heap memory.
template <typename Use>
void for_each_entry(const char* folder, const Use& use) {
  const Opened opened(folder, O_DIRECTORY);
  alignas(dirent64) std::array<char, 4096> entries{};
  while (true) {
    const long length =
        ::syscall(SYS_getdents64, opened.descriptor, entries.data(), entries.size());
    if (length <= 0) return;
    for (long at = 0; at < length;) {
      const auto* entry = reinterpret_cast<const dirent64*>(entries.data() + at);
      use(static_cast<const char*>(entry->d_name));
      at += entry->d_reclen;
    }
  }
}

}  // namespace

ProcessorShare::Times ProcessorShare::now() {
  Times sum;
  for_each_entry("/proc/self/task", [&](const char* thread) {
    std::array<char, 300> path{};
    std::snprintf(path.data(), path.size(), "/proc/self/task/%s/schedstat", thread);
    const Opened opened(path.data());
    std::array<char, 96> text{};
    if (::read(opened.descriptor, text.data(), text.size() - 1) <= 0) return;
    char* rest = nullptr;
    sum.ran += std::strtoull(text.data(), &rest, 10);
    sum.queued += std::strtoull(rest, nullptr, 10);
  });
  return sum;
}

double ProcessorShare::since_last() {
  const Times before = last_;
  last_ = now();
  // The times of a thread that has ended are lost, so a sum can fall.
  const std::uint64_t ran = last_.ran - std::min(last_.ran, before.ran);
  const std::uint64_t queued = last_.queued - std::min(last_.queued, before.queued);
  if (queued == 0) return 1;
  return std::max(kLeast, static_cast<double>(ran) / static_cast<double>(ran + queued));
}

}  // namespace trammel
