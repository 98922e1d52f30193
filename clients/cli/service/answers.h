#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/cli/files/target_file.h"
#include "clients/session/session.h"
#include "server/base/note.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/files/joint_list.h"

/// Predictions and corrections in the units of files and of the wire, whether this program or a
/// service made them.
namespace trammel::cli {

[[nodiscard]] client::PoseMm to_wire(const Pose& X_BT);
[[nodiscard]] client::PredictedError to_wire(const ErrorPrediction& prediction);
[[nodiscard]] client::CorrectedTarget to_wire(const Correction& correction,
                                              const std::vector<JointType>& joint_types);
/// rad, of a prismatic joint mm.
[[nodiscard]] std::vector<double> to_wire(const JointVector& q,
                                          const std::vector<JointType>& joint_types);
[[nodiscard]] client::TargetMm to_wire(const Target& target,
                                       const std::vector<JointType>& joint_types);
/// As a server reads them: what is computed here has the same bytes as what a server answers.
[[nodiscard]] Target from_wire(const client::TargetMm& wanted, const Chain& robot);
[[nodiscard]] JointVector from_wire(const std::vector<double>& wire, const Chain& robot);

/// The approach of the arm to a pose, as far as that is known.
[[nodiscard]] client::Approach approach_of(const PoseContext& context);

/// The covariances between the coordinates of a prediction.
struct JointUncertainty {
  double cxy_mm2 = 0, cxz_mm2 = 0, cyz_mm2 = 0;  ///< covariances of one measurement's coordinates
};
[[nodiscard]] JointUncertainty joint_uncertainty(const client::PredictedError& prediction);

/// About the axes of the base, of one measurement of the orientation.
struct RotationUncertainty {
  double srx_deg = 0, sry_deg = 0, srz_deg = 0;
};
/// Refuses a prediction of a model that did not learn orientations.
[[nodiscard]] Result<RotationUncertainty> rotation_uncertainty(
    const client::PredictedError& prediction);

/// Answers with the id of the one model that gave them.
struct Predictions {
  std::string model_id;
  std::vector<client::PredictedError> items;     ///< one a pose of the list
  std::vector<JointUncertainty> together = {};   ///< likewise where it was asked for, else none
  std::vector<RotationUncertainty> turned = {};  ///< likewise
  std::vector<Note> notes = {};                  ///< of the model
};
struct Corrections {
  std::string model_id;
  std::vector<JointType> joint_types;
  std::vector<client::CorrectedTarget> items;  ///< one a target
  std::vector<Note> notes = {};                ///< of the model
};

/// `dx_mm` ... `in_domain`, the predicted pose X_BT, `pose_id`, `model_id`; where asked for,
/// `cxy_mm2` ... `slz_mm` and `srx_deg` ...
[[nodiscard]] std::string predictions_csv(const JointList& list, const Predictions& predictions);
[[nodiscard]] nlohmann::ordered_json predictions_json(const JointList& list,
                                                      const Predictions& predictions);

/// The columns of the target file, then `row` (line in that file), `status`, the pose and joints to
/// command, errors to expect, `iterations`, `model_id`, `message`. A column of the file that is
/// named as one of these comes as `input_NAME`. A target that is not corrected has no pose and no
/// joints to command, and an error only if it is known.
[[nodiscard]] std::string corrections_csv(const TargetFile& file, const Corrections& corrections);
[[nodiscard]] nlohmann::ordered_json corrections_json(const TargetFile& file,
                                                      const Corrections& corrections);
/// `12 targets: 10 ok, 2 unreachable`
[[nodiscard]] std::string corrections_summary(const Corrections& corrections);
/// `2 of 12 targets are left as they were:` and a line `t.csv row 4: joint_limit: joint 5 would be
/// ...` for each, at most ten; empty where none is.
[[nodiscard]] std::string left_alone_text(const TargetFile& file, const Corrections& corrections);

}  // namespace trammel::cli
