#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// A commanded pose without a measurement.
struct CommandedPose {
  std::string pose_id;
  PoseContext context;
  int row = 0;  ///< line in its file, for messages
};

/// Poses in order: a measuring plan, or joints to predict for.
struct JointList {
  std::string where;                   ///< the file as messages name it
  std::vector<JointType> joint_types;  ///< from the columns: `q1_deg` or, for a rail, `q7_mm`
  std::vector<CommandedPose> poses;
};

/// Reads a CSV with `q1_deg` ... `qn_deg` and any of the optional columns of a batch; other columns
/// are ignored. Refuses as parse_batch_csv() does.
[[nodiscard]] Result<JointList> parse_joint_csv(const std::string& text, const std::string& where);
[[nodiscard]] Result<JointList> read_joint_csv(const std::string& path);
/// The list as parse_joint_csv() reads it; directions, tools and payloads only where a pose has
/// them.
[[nodiscard]] std::string to_csv(const JointList& list);

/// Checks the list against `cell`, as batches are checked: number of joints, joint limits, tool and
/// payload. Resolves tool and payload ids. Refuses joints that look like radians.
[[nodiscard]] Result<JointList> check_against_cell(JointList list, const Cell& cell);

}  // namespace trammel
