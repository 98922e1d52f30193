#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "server/compensate/compensated_model.h"
#include "server/robot/cell.h"

/// A cell with trainings of milliseconds: the shipped robot, with the base as the only error source
/// and without a bias.
namespace trammel::test {

[[nodiscard]] std::string small_robot_yaml();
[[nodiscard]] std::string small_cell_yaml(const std::string& name,
                                          const std::string& bias = "none");
[[nodiscard]] std::shared_ptr<const Cell> small_cell(const std::string& name,
                                                     const std::string& bias = "none");

struct SmallBatch {
  int poses = 40;
  double base_shift = 2e-3;  ///< m, how far the real base stands from the nominal one along x
  double noise = 20e-6;      ///< m, of one coordinate
  std::uint64_t seed = 1;
  std::string set = {};  ///< when not empty: the `set` column of every row
};
/// The batch that such a cell would measure.
[[nodiscard]] std::string small_batch_csv(const Cell& cell, const SmallBatch& batch);

/// A model without error sources that claims `training_poses` training poses, so that two such
/// models differ in content.
[[nodiscard]] CompensatedModel nominal_model(const std::shared_ptr<const Cell>& cell,
                                             int training_poses);

}  // namespace trammel::test
