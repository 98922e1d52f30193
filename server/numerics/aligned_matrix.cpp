#include "server/numerics/aligned_matrix.h"

#include <sys/mman.h>

#include <cstdlib>
#include <cstring>
#include <new>

#include "server/numerics/numerics_table.h"

namespace trammel {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{2} << 20U;

}  // namespace

AlignedMatrix::AlignedMatrix(Eigen::Index rows, Eigen::Index cols) : rows_(rows), cols_(cols) {
  const std::size_t bytes = static_cast<std::size_t>(rows * cols) * sizeof(double);
  if (bytes < kHugePage) {
    const std::size_t size = (bytes / kCacheLine + 1) * kCacheLine;
    auto* data = static_cast<double*>(std::aligned_alloc(kCacheLine, size));
    if (data == nullptr) throw std::bad_alloc();
    data_ = {data, Release(data, 0)};
    std::memset(data, 0, bytes);
    return;
  }
  // Pages from the system are zero, and take memory only once they are touched.
  const std::size_t size = (bytes / kHugePage + 2) * kHugePage;
  void* block = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (block == MAP_FAILED) throw std::bad_alloc();
  // Only advice: a system without huge pages is slower, not wrong.
  madvise(block, size, MADV_HUGEPAGE);
  const std::size_t start = reinterpret_cast<std::size_t>(block);
  auto* data = reinterpret_cast<double*>((start + kHugePage - 1) / kHugePage * kHugePage);
  data_ = {data, Release(block, size)};
}

void AlignedMatrix::forget_columns_from(Eigen::Index col) {
  const Release& mapped = data_.get_deleter();
  if (mapped.size == 0) return;
  const std::size_t first = reinterpret_cast<std::size_t>(data_.get() + col * rows_);
  const std::size_t start = (first + kHugePage - 1) / kHugePage * kHugePage;
  const std::size_t end = reinterpret_cast<std::size_t>(mapped.block) + mapped.size;
  if (start < end) madvise(reinterpret_cast<void*>(start), end - start, MADV_DONTNEED);
}

AlignedMatrix AlignedMatrix::copy() const {
  AlignedMatrix copy(rows_, cols_);
  copy.map() = map();
  return copy;
}

AlignedMatrix factor_storage(Eigen::Index rows) {
  const Eigen::Index padded = padded_rows(rows);
  // Columns that are a multiple of 512 bytes apart would put whole rows into the same few cache
  // sets.
  return {padded % 64 == 0 ? padded + kTargetBlock : padded, padded};
}

void AlignedMatrix::Release::operator()(double* /*data*/) const {
  if (size > 0) {
    munmap(block, size);
  } else {
    std::free(block);
  }
}

}  // namespace trammel
