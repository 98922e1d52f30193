#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// The shipped cell `cell-7` with the shipped virtual robot.
namespace trammel::test {

[[nodiscard]] std::string shipped_cell_file();
/// The batch that its tracker would measure at `poses` joint vectors drawn from the cell's ranges.
[[nodiscard]] std::string virtual_batch_csv(int poses, std::uint64_t seed);
/// Joint vectors of the cell, rad, for asking.
[[nodiscard]] std::vector<std::vector<double>> virtual_joints(int poses, std::uint64_t seed);

}  // namespace trammel::test
