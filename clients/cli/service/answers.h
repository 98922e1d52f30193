#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/cli/files/target_file.h"
#include "clients/session/session.h"
#include "server/base/note.h"
#include "server/exchange/si.h"
#include "server/measurement/files/joint_list.h"

/// Predictions and corrections as text and JSON, whether this program or a service made them.
namespace trammel::cli {

/// Answers with the id of the one model that gave them.
struct Predictions {
  std::string model_id;
  std::vector<exchange::Prediction> items;  ///< one a pose of the list
  std::vector<Note> notes = {};             ///< of the model
  bool covariance = false;                  ///< true: these are written, too
  bool orientation = false;                 ///< likewise; every item has them then
};
struct Corrections {
  std::string model_id;
  std::vector<JointType> joint_types;
  std::vector<exchange::CorrectedTarget> items;  ///< one a target
  std::vector<Note> notes = {};                  ///< of the model
  /// Points to go to before each target, status `lead_in`; empty if none were requested
  std::vector<std::vector<exchange::CorrectedTarget>> lead_ins = {};
  std::vector<double> turned_deg = {};  ///< about the tool's axis; empty: it was not free

  [[nodiscard]] std::size_t lead_in_points() const;
};

/// `dx_mm` ... `in_domain`, the predicted pose X_BT, `pose_id`, `model_id`; on request, `cxy_mm2`
/// ... `slz_mm` and `srx_deg` ...
[[nodiscard]] std::string predictions_csv(const JointList& list, const Predictions& predictions);
[[nodiscard]] nlohmann::ordered_json predictions_json(const JointList& list,
                                                      const Predictions& predictions);

/// The columns of the target file, then `row` (line in that file), `status`, the pose and joints to
/// command, expected errors, `iterations`, `model_id`, `message`, and `turned_rz_deg` if the tool
/// was free to turn. A lead-in consists of rows with status `lead_in` above the row of the target.
/// A column of the file with one of these names becomes `input_NAME`. A target that is not
/// corrected has no pose and no joints to command, and an error only if it is known.
[[nodiscard]] std::string corrections_csv(const TargetFile& file, const Corrections& corrections);
[[nodiscard]] nlohmann::ordered_json corrections_json(const TargetFile& file,
                                                      const Corrections& corrections);
/// `12 targets: 10 ok, 2 unreachable`
[[nodiscard]] std::string corrections_summary(const Corrections& corrections);
/// `2 of 12 targets are left as they were:` and one line for each, at most ten: `t.csv row 4:
/// joint_limit: joint 5 would be ...`. Empty if no target was left.
[[nodiscard]] std::string left_alone_text(const TargetFile& file, const Corrections& corrections);

}  // namespace trammel::cli
