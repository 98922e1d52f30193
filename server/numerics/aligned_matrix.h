#pragma once

#include <Eigen/Dense>
#include <memory>

namespace trammel {

/// A column-major matrix of doubles, zero at first, that starts on a cache line. A large one asks
/// for huge pages: a factorisation touches a page for each column, and with small pages most of its
/// time would go into looking up their addresses. Movable, not copyable.
class AlignedMatrix {
 public:
  AlignedMatrix() = default;
  AlignedMatrix(Eigen::Index rows, Eigen::Index cols);

  [[nodiscard]] AlignedMatrix copy() const;
  /// Frees the memory of the columns from `col` on; their contents are undefined afterwards.
  void forget_columns_from(Eigen::Index col);
  [[nodiscard]] Eigen::Index rows() const { return rows_; }
  [[nodiscard]] Eigen::Index cols() const { return cols_; }
  [[nodiscard]] double* data() { return data_.get(); }
  [[nodiscard]] const double* data() const { return data_.get(); }
  [[nodiscard]] double& operator()(Eigen::Index row, Eigen::Index col) {
    return data_[index(row, col)];
  }
  [[nodiscard]] double operator()(Eigen::Index row, Eigen::Index col) const {
    return data_[index(row, col)];
  }
  [[nodiscard]] Eigen::Map<Eigen::MatrixXd> map() { return {data(), rows_, cols_}; }
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> map() const { return {data(), rows_, cols_}; }

 private:
  struct Release {
    Release() : block(nullptr), size(0) {}
    Release(void* start, std::size_t mapped) : block(start), size(mapped) {}
    void operator()(double* data) const;
    void* block;
    std::size_t size;  // of the mapping; 0: from the heap
  };
  [[nodiscard]] std::size_t index(Eigen::Index row, Eigen::Index col) const {
    return static_cast<std::size_t>(row + col * rows_);
  }

  Eigen::Index rows_ = 0;
  Eigen::Index cols_ = 0;
  std::unique_ptr<double[], Release> data_;
};

/// Room for `rows` rows and columns as the factorisations of numerics_table.h want it: padded, and
/// with a leading dimension that spreads a row over all cache sets.
[[nodiscard]] AlignedMatrix factor_storage(Eigen::Index rows);

}  // namespace trammel
