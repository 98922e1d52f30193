#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_model.h"
#include "server/compensate/bias_physics.h"
#include "server/compensate/correction.h"
#include "server/compensate/evaluation.h"
#include "server/compensate/model_parts.h"
#include "server/compensate/paired_gain.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel {

/// The error expected at one joint vector, all in B.
struct ErrorPrediction {
  Pose X_BT_nominal;                   ///< the tool's pose by the controller's own model
  Pose X_BT_predicted;                 ///< the predicted pose
  Vector3 error_B = Vector3::Zero();   ///< predicted - nominal, m
  Vector3 stddev_B = Vector3::Zero();  ///< m, of one measurement of the position
  /// The standard deviation of the true error, m: as above without the tracker's own noise.
  Vector3 true_stddev_B = Vector3::Zero();
  /// The covariance of one measurement, m²; stddev_B is the root of its diagonal.
  Matrix3 covariance_B = Matrix3::Zero();
  /// The standard deviation of one measured orientation, rad, about the axes of B; only where the
  /// model learned orientations.
  std::optional<Vector3> rotation_stddev_B;
  bool in_domain = false;  ///< false: far from all training poses, or the bias is not fully taken
  double bias_weight =
      0;  ///< share of the bias' kernel in error_B: 1 in domain, 0 well outside the joints' ranges
};

/// Nominal chain, identified error sources and learned bias, with which the requests to a cell are
/// answered. An immutable value, cheap to copy, thread-safe.
class CompensatedModel {
 public:
  using Parts = ModelParts;
  /// Refuses parts that do not fit each other, and the same as BiasModel::restore().
  [[nodiscard]] static Result<CompensatedModel> make(Parts parts);

  [[nodiscard]] const Parts& parts() const { return inside_->parts; }
  [[nodiscard]] const Cell& cell() const { return *inside_->parts.physics.cell; }
  [[nodiscard]] const ModelProvenance& provenance() const { return inside_->parts.provenance; }

  /// Refuses a tool with a payload that no training pose had: the model learned from the trained
  /// ones only. A bias at the flange holds for every tool of the cell file that weighs the same as
  /// a trained one.
  [[nodiscard]] Status check_trained_with(const std::string& tool,
                                          const std::string& payload) const;
  /// The error expected at `q`, whose size the caller has checked; tool and payload as
  /// resolve_tool() gives them.
  [[nodiscard]] ErrorPrediction predict(const JointVector& q, const std::string& tool,
                                        const std::string& payload) const;
  /// predict() at many poses, faster for a bias with blocks.
  [[nodiscard]] std::vector<ErrorPrediction> predict_all(
      const std::vector<PoseContext>& poses) const;
  /// The physics with which the bias was learned.
  [[nodiscard]] BiasPhysics learned_physics() const;
  /// The learned bias, if any, and the features of a pose for it.
  [[nodiscard]] const std::optional<BiasModel>& bias() const { return inside_->bias; }
  [[nodiscard]] BiasFeatures features(const PoseContext& context) const {
    return inside_->bias_physics.at(context);
  }
  /// Target correction, source section 3.4.1.
  [[nodiscard]] Correction correct(const Target& target, const std::string& tool,
                                   const std::string& payload,
                                   const CorrectOptions& options = {}) const;
  /// Measured minus predicted of every pose at the three levels, 3 x N, m, in B.
  struct LevelErrors {
    Eigen::Matrix3Xd nominal, calibrated, compensated;
    Eigen::Matrix3Xd stddev;  ///< as predicted, of compensated
    std::vector<bool> in_domain;
    /// The errors of the measured orientations, rotation vectors, rad; `stddev` is 3 x 0 where none
    /// was learned.
    struct Rotations {
      Eigen::Matrix3Xd nominal, calibrated, compensated, stddev;
    };
    Rotations rotation = {};
  };
  /// All rows must have positions.
  [[nodiscard]] LevelErrors errors_B(const MeasurementBatch& batch) const;
  /// Measured minus predicted of every number of the gauges, m, at the three levels, and the
  /// standard deviation of compensated.
  struct GaugeErrors {
    std::vector<std::size_t> rows;  ///< of the batch; a contact's stands three times
    Eigen::VectorXd nominal, calibrated, compensated, stddev;
    std::vector<bool> in_domain;
  };
  /// The model must know their anchors, or its cell file where they are (in_world_of()).
  [[nodiscard]] GaugeErrors gauge_errors(const MeasurementBatch& batch) const;
  /// Figures of the errors on `batch`, which is checked against the cell and not empty. Poses of
  /// another batch than the model's own are predicted as in service: changes that began at a
  /// training pose have happened, and errors of the tracker do not count.
  [[nodiscard]] Evaluation evaluate(const MeasurementBatch& batch) const;

 private:
  [[nodiscard]] Evaluation evaluate_positions(const MeasurementBatch& batch) const;
  struct Inside {
    explicit Inside(BiasPhysics physics) : bias_physics(std::move(physics)) {}
    Parts parts;
    BiasPhysics bias_physics;
    std::optional<BiasModel> bias;
    std::optional<BiasModel> rotation_bias;
    bool bias_has_parameters = false;
    std::optional<Matrix3> bias_turn;       // of a bias with an origin, BiasPhysics::turn_to()
    Vector3 bias_size_B = Vector3::Zero();  // m, rms over the training poses; 0 with blocks
    Vector3 rotation_bias_size_B = Vector3::Zero();  // rad, likewise; 0 with the block `parameters`
  };
  /// Restores the biases of `parts`; `then`: the physics beside which they were learned.
  [[nodiscard]] static Status restore_biases(const Parts& parts, const BiasPhysics& then,
                                             Inside* inside);
  /// True if the bias holds for this tool and payload.
  [[nodiscard]] bool learned_with(const std::string& tool, const std::string& payload) const;
  /// The biases' prediction at a pose.
  struct Learned {
    BiasPrediction position;
    std::optional<BiasPrediction> rotation;
  };
  /// With the mean temperature of the training where none is given.
  [[nodiscard]] PoseContext completed(PoseContext asked) const;
  [[nodiscard]] ErrorPrediction predict(const PoseContext& asked) const;
  [[nodiscard]] ErrorPrediction predict(const PoseContext& asked, const Learned* learned) const;
  /// The arm at a pose according to the calibration.
  struct CalibratedPose {
    PoseContext context;  ///< completed
    Pose X_BW = Pose::Identity();
    Eigen::MatrixXd J_W;  ///< 6 x P, by the parameters
    double growth = 0;    ///< m², Domain::growth()
  };
  /// 3 x 3, in B: the covariance of a position or rotation by the parameters, given its derivatives
  /// (3 x P, in B); and the part of it that was identified after the bias was learned.
  [[nodiscard]] Matrix3 identified(const Eigen::MatrixXd& J_B) const;
  [[nodiscard]] Matrix3 identified_since(const Eigen::MatrixXd& J_B) const;
  /// m²: variance of one axis of the physics' residual at a pose.
  [[nodiscard]] double unlearned(const CalibratedPose& pose) const;
  /// `covariance` of one measurement with the bias_spread applied to the used part of the bias; the
  /// instrument's part is unchanged.
  [[nodiscard]] Matrix3 spread(const Matrix3& covariance, double bias_weight) const;
  /// Adds the bias with the weight in `prediction`. Returns the new covariance, without the part of
  /// unstated quantities.
  [[nodiscard]] Matrix3 add_position_bias(const CalibratedPose& pose, const BiasPrediction& bias,
                                          ErrorPrediction* prediction) const;
  void add_rotation_bias(const CalibratedPose& pose, const BiasPrediction& bias,
                         ErrorPrediction* prediction) const;
  [[nodiscard]] std::vector<Learned> learned(const std::vector<PoseContext>& poses) const;
  /// Turned from B of the training into B of today.
  [[nodiscard]] std::vector<Learned> turn(std::vector<Learned> all) const;
  /// The way by which the biases move the tool, in B.
  struct LearnedMotion {
    Vector3 shift = Vector3::Zero();
    Matrix3 turn = Matrix3::Identity();
  };
  [[nodiscard]] LearnedMotion learned_motion(const PoseContext& completed,
                                             double bias_weight) const;
  /// X_BT of the physics alone.
  [[nodiscard]] Pose calibrated_pose_B(const PoseContext& completed) const;
  [[nodiscard]] static Pose moved(const Pose& X_BT, const LearnedMotion& by);
  /// X_BT as predict() has it, without the variances.
  [[nodiscard]] Pose pose_B(const PoseContext& asked, double bias_weight) const;
  /// Covariance of the position, in B, by quantities that a source needs but the request does not
  /// state: the approach direction of a joint, or the temperature.
  [[nodiscard]] Matrix3 covariance_of_unsaid(const PoseContext& context, bool temperature_unsaid,
                                             const Vector3& p_B) const;
  /// The joints to which the controller moves for the target without a correction.
  [[nodiscard]] Result<InverseResult> nominal_joints(const Target& target, const Pose& X_TF) const;
  /// The end of the iteration for the joints that bring the tool to the target pose.
  struct Approach {
    Pose X_BT_commanded;
    InverseResult joints;  ///< the last ones; not kOk: the iteration ended there
    Vector6 missing;       ///< to the wanted pose: m, rad
    int iterations = 0;
    bool settled = false;
  };
  /// From the joints in `context`, where the tool is predicted to be at `X_BT_predicted`.
  [[nodiscard]] Approach approach(const Pose& X_BT_wanted, PoseContext context,
                                  const Pose& X_BT_predicted, double bias_weight,
                                  const CorrectOptions& options) const;
  /// The other branches (conf) on which the target can be corrected; empty for an arm whose
  /// branches have no numbers.
  [[nodiscard]] std::vector<int> branches_that_reach(const Target& asked, const Pose& X_BT_wanted,
                                                     PoseContext context,
                                                     const CorrectOptions& options) const;
  void add_rotations(const MeasurementBatch& batch, const std::vector<PoseContext>& poses,
                     const std::vector<ErrorPrediction>& predictions, LevelErrors* errors) const;
  [[nodiscard]] bool is_own(const MeasurementBatch& batch) const;
  explicit CompensatedModel(std::shared_ptr<const Inside> inside) : inside_(std::move(inside)) {}
  std::shared_ptr<const Inside> inside_;
};

/// The gain in the compensated positions of `batch`, whose tools both models know.
[[nodiscard]] PairedGain paired_gain(const CompensatedModel& before, const CompensatedModel& after,
                                     const MeasurementBatch& batch);

}  // namespace trammel
