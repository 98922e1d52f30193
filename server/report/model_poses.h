#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// A pose that shows how good a model is, and its errors in B, m.
struct ShownPose {
  std::string id;
  JointVector q;
  std::optional<PoseContext>
      context;  ///< with tool and payload; empty where a model file does not say them
  std::optional<Vector3> nominal;  ///< measured - nominal; empty where the context is not known
  Vector3 calibrated = Vector3::Zero(), compensated = Vector3::Zero();
  Vector3 stddev = Vector3::Zero();  ///< of compensated, as the model states it for one measurement
  bool in_domain = true;
};

struct ShownPoses {
  std::string title;  ///< which poses
  std::vector<ShownPose> poses;
};

/// The poses of `batch`; otherwise those that the bias learned from, each predicted from all the
/// others; otherwise none.
[[nodiscard]] ShownPoses poses_to_show(const CompensatedModel& model,
                                       const std::optional<MeasurementBatch>& batch);

/// The number of poses by their error at each level: bins of thirds of a decade. Null without
/// poses.
[[nodiscard]] nlohmann::ordered_json histogram_json(const ShownPoses& shown);
/// Which share of coordinates lies inside the interval that should hold 50 %, 68 %...; null with
/// fewer than 8 poses.
[[nodiscard]] nlohmann::ordered_json coverage_json(const ShownPoses& shown);

/// The poses with the largest errors, as HTML.
[[nodiscard]] std::string pose_table(const ShownPoses& shown);

/// The worth of fewer and of more poses.
struct LearningCurve {
  std::string what, sentence;      ///< for people
  std::vector<int> poses = {};     ///< rising
  std::vector<double> error = {};  ///< m
};
/// The curve of a bias: the error at left-out poses, with a part of the poses and with all but one.
/// For a model without a bias: the stated accuracy (PositionAccuracy) if the parameters' covariance
/// shrinks as poses are added. Empty with too few poses, or with so many that it would take long.
[[nodiscard]] std::optional<LearningCurve> learning_curve(const CompensatedModel& model);

}  // namespace trammel
