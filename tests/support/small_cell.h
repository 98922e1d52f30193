#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "server/compensate/compensated_model.h"
#include "server/robot/cell.h"

/// A cell whose trainings take milliseconds: the shipped robot, its base the only error source,
/// nothing learned.
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

/// A model without error sources that claims to have been trained on `training_poses`: two of them
/// differ in content.
[[nodiscard]] CompensatedModel nominal_model(const std::shared_ptr<const Cell>& cell,
                                             int training_poses);

}  // namespace trammel::test
