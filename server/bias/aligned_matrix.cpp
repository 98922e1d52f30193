#include "server/bias/aligned_matrix.h"

#include <sys/mman.h>

#include <cstdlib>
#include <cstring>
#include <new>

namespace trammel {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{2} << 20U;

}  // namespace

AlignedMatrix::AlignedMatrix(Eigen::Index rows, Eigen::Index cols) : rows_(rows), cols_(cols) {
  const std::size_t bytes = static_cast<std::size_t>(rows * cols) * sizeof(double);
  const std::size_t alignment = bytes >= kHugePage ? kHugePage : kCacheLine;
  const std::size_t size = (bytes / alignment + 1) * alignment;
  auto* data = static_cast<double*>(std::aligned_alloc(alignment, size));
  if (data == nullptr) throw std::bad_alloc();
  data_.reset(data);
  // Advice: a kernel without huge pages is slower, not wrong.
  if (bytes >= kHugePage) madvise(data, size, MADV_HUGEPAGE);
  std::memset(data, 0, bytes);
}

AlignedMatrix AlignedMatrix::copy() const {
  AlignedMatrix copy(rows_, cols_);
  copy.map() = map();
  return copy;
}

void AlignedMatrix::Release::operator()(double* data) const { std::free(data); }

}  // namespace trammel
