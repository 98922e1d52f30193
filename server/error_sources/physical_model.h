#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/error_sources/error_source.h"
#include "server/error_sources/spelling.h"

namespace trammel {

/// The nominal chain and error sources with a value for each parameter: predicts the real tool pose
/// by physics alone. An immutable value once built; thread-safe.
struct PhysicalModel {
  std::shared_ptr<const Cell> cell;
  Pose X_WB = Pose::Identity();  ///< nominal base: the cell's, or found from data where the cell
                                 ///< says unknown
  std::map<std::string, Pose> tools;  ///< X_FT likewise
  std::vector<ErrorSourcePtr> sources;
  Eigen::VectorXd values;  ///< SI, the parameters of all sources one after the other

  [[nodiscard]] int parameter_count() const;
  /// The parameters of all sources in order.
  [[nodiscard]] std::vector<Parameter> parameters() const;
  [[nodiscard]] Eigen::VectorXd prior_values() const;

  /// X_WT of the chain alone: no error source.
  [[nodiscard]] Pose nominal_pose_W(const PoseContext& context) const;
  /// The arm with every source applied.
  [[nodiscard]] ArmState state(const PoseContext& context) const;
  /// X_WT with every source.
  [[nodiscard]] Pose pose_W(const PoseContext& context) const;
  /// X_WT and the 6 x P derivative [dp; rotation vector] in W by the parameters, at
  /// `parameter_values`.
  Pose pose_W(const PoseContext& context, const Eigen::VectorXd& parameter_values,
              Eigen::MatrixXd* jacobian) const;

 private:
  [[nodiscard]] ArmState nominal_state(const PoseContext& context) const;
};

/// Puts `source` at its place in the acting order, at its prior values; index of its first value.
Eigen::Index add_source(PhysicalModel& model, ErrorSourcePtr source);

/// A model of `cell` with the sources that `specs` name, at their prior values; `joint_map:*` names
/// one for each joint that can have it. An unknown base or tool is identity until it is found.
[[nodiscard]] Result<PhysicalModel> make_physical_model(std::shared_ptr<const Cell> cell,
                                                        const std::vector<std::string>& specs);

}  // namespace trammel
