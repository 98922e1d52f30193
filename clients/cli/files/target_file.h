#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"
#include "server/robot/chain.h"

namespace trammel::cli {

/// A target with its line in the file.
struct TargetRow {
  int row = 0;
  exchange::AskedTarget target;
  std::vector<std::string> fields = {};  ///< the texts in the file, one per column
};

struct TargetFile {
  std::string where;
  std::vector<JointType> joint_types;  ///< of the joint columns; empty when there are none
  std::vector<TargetRow> rows;
  std::vector<std::string> columns = {};  ///< all columns of the file
};

/// Reads targets (CSV, mm and deg): `x_mm,y_mm,z_mm,qw,qx,qy,qz` (X_BT) with `conf` (0..7) or
/// `q1_deg`... as the seed, or `q1_deg`... alone. `dir1`..., `temperature_c` and `time_s` say how
/// the arm comes there. Other columns are kept. Refuses as batches are, and a pose with neither
/// conf nor seed.
[[nodiscard]] Result<TargetFile> parse_targets_csv(const std::string& text,
                                                   const std::string& where);
[[nodiscard]] Result<TargetFile> read_targets_csv(const std::string& path);

/// True if every position is so near to the base that its numbers may be metres.
[[nodiscard]] bool may_be_metres(const TargetFile& file);
/// The refusal of such a file.
[[nodiscard]] Error looks_like_metres(const TargetFile& file);

/// Refuses joint and direction columns that do not belong to the robot, and conf if the robot's
/// branches have no closed form. Refuses positions that are all small enough for metres, if their
/// median is within a hundredth of the arm's length.
[[nodiscard]] Status check_targets(const TargetFile& file, const Chain& robot);

}  // namespace trammel::cli
