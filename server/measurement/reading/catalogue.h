#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/measurement/reading/number_table.h"
#include "server/robot/cell.h"

/// The mistakes that measured batches come with.
namespace trammel::reading {

/// One possible reading of the numbers of a batch.
struct Reading {
  std::string name;      ///< after "read ": `with q2_deg and q3_deg exchanged`
  std::string columns;   ///< the columns that it concerns: `q2_deg,q3_deg`
  bool of_rows = false;  ///< other rows belong together: it needs the whole table
  std::function<NumberTable(NumberTable)> apply;
  std::optional<Chain> robot = {};  ///< the robot file is read in another way, the numbers are not
  std::string the_same = {};  ///< other readings with the same effect, after "or "; empty: none
};

/// All mistakes in joint columns that are tried: two columns exchanged, another sign, unit or zero,
/// a joint that was counted with its neighbour.
[[nodiscard]] std::vector<Reading> joint_readings(const NumberTable& table, const Chain& robot);
/// Likewise for the measured positions; for a batch with orientations also a left-handed frame.
[[nodiscard]] std::vector<Reading> position_readings(const NumberTable& table);
/// The table of the robot file in another convention: Craig's, which tells a and alpha one row
/// later.
[[nodiscard]] std::vector<Reading> robot_readings(const Chain& robot);
/// Mistakes in the order of rows: joints that belong to a neighbouring row, or to a row at a shift
/// that the distances from pose to pose suggest.
[[nodiscard]] std::vector<Reading> row_readings(const NumberTable& table, const Cell& cell);

}  // namespace trammel::reading
