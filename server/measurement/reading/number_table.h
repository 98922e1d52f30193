#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

namespace trammel::reading {

/// The numbers of a batch, row by row, which readings reinterpret.
struct NumberTable {
  Eigen::MatrixXd q;     ///< joints x rows, as commanded, rad (m)
  Eigen::Matrix3Xd p_W;  ///< m
  std::vector<std::optional<Matrix3>> R_WT;
  std::vector<const Measurement*> from;  ///< the measurement of each position

  [[nodiscard]] std::size_t size() const { return from.size(); }
  [[nodiscard]] JointVector joints(std::size_t row) const {
    return q.col(static_cast<Eigen::Index>(row));
  }
  [[nodiscard]] Vector3 position(std::size_t row) const {
    return p_W.col(static_cast<Eigen::Index>(row));
  }
};

/// The measurements must outlive the table.
[[nodiscard]] NumberTable table_of(const MeasurementBatch& batch);
/// Positions and orientations of `rows`, each with the joints of the row at the same place in
/// `joints_of`.
[[nodiscard]] NumberTable matched(const NumberTable& table, const std::vector<std::size_t>& rows,
                                  const std::vector<std::size_t>& joints_of);
/// About `most` rows, evenly drawn from those of each tool. Every tool keeps rows, however few it
/// has, and in any order of the tools.
[[nodiscard]] NumberTable thinned(const NumberTable& table, std::size_t most);

}  // namespace trammel::reading
