#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_model.h"
#include "server/bias/choose_bias.h"
#include "server/calibrate/calibrate.h"
#include "server/compensate/bias_physics.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel {

/// Error figures of a set of poses: |measured - predicted|, m.
struct ErrorFigures {
  double rms = 0, mean = 0, p997 = 0, max = 0;
  Vector3 axis_mean = Vector3::Zero(), axis_stddev = Vector3::Zero();  ///< in B
};
/// Of the errors in the columns of `e_B` (3 x N, m, not empty).
[[nodiscard]] ErrorFigures figures_of(const Eigen::Matrix3Xd& e_B);

/// Orientation errors of the poses that have a measured orientation, rms of the rotation angle, rad.
struct OrientationFigures {
  int poses = 0;
  double nominal = 0, calibrated = 0, compensated = 0;
  std::optional<double> coverage_95;  ///< share of coordinates inside their 95 % interval; where orientation is learned
};

/// The three levels of one model on one set of poses.
struct Evaluation {
  int poses = 0;
  ErrorFigures nominal, calibrated, compensated;
  double coverage_95 = 0;  ///< share of coordinates inside their 95 % interval
  int in_domain = 0;
  /// Mean over coordinates of -log N(error; 0, stddev²), compensated, nat, of positions in m; in mm it is 6.9 more
  /// (nlpd_in_mm). Less is better: it rewards small errors and honest stddevs. Empty where a stddev is 0, and in models
  /// of before it was kept.
  std::optional<double> nlpd;
  std::optional<OrientationFigures> orientation;  ///< where orientations were measured
  /// Of a model with a bias, PairedGain::z() of compensated over calibrated, pose by pose; empty in models of before.
  std::optional<double> bias_gain_z;
};
[[nodiscard]] double nlpd_in_mm(double nlpd_in_m);

/// The error expected at one joint vector, all in B.
struct ErrorPrediction {
  Pose X_BT_nominal;                   ///< where the controller believes the tool to be
  Pose X_BT_predicted;                 ///< where it will be
  Vector3 error_B = Vector3::Zero();   ///< predicted - nominal, m
  Vector3 stddev_B = Vector3::Zero();  ///< of one measurement of it, m
  /// Of the true error: the same without what the tracker's own sigma adds, m.
  Vector3 true_stddev_B = Vector3::Zero();
  /// Of one measurement, m^2, the three axes together: stddev_B is the root of its diagonal.
  Matrix3 covariance_B = Matrix3::Zero();
  /// Of one measurement of the orientation, rad, about the axes of B; where the model learned orientations.
  std::optional<Vector3> rotation_stddev_B;
  bool in_domain = false;  ///< false: what the bias learned of poses nearby is not, or not fully, in error_B
  double bias_weight = 0;  ///< how much of it is, in [0, 1]: 1 in domain, 0 well outside. Blocks of a bias stay
};

enum class CorrectionStatus { kOk, kOutOfDomain, kJointLimit, kUnreachable, kSingular, kNotConverged, kRefused };
/// As files and the wire spell it: `ok`, `out_of_domain`, ...
[[nodiscard]] std::string_view to_string(CorrectionStatus status);

/// A tool pose that is wanted, or the joints that a program commands.
struct Target {
  Pose X_BT = Pose::Identity();
  std::optional<JointVector> seed;  ///< joints near the wanted branch, rad
  std::optional<int> conf;          ///< or the branch, 0..7, see inverse_kinematics.h
  bool joint_target = false;        ///< X_BT is unset: the pose wanted is the nominal one of `seed`
};

/// A target as corrected; one that is neither ok nor out of domain is left alone: commanded as it was wanted. What to
/// expect are root mean squares of the true distance from the target, without the instrument's own noise; NaN where no
/// joints bring the tool there, so that nothing can be said.
struct Correction {
  CorrectionStatus status = CorrectionStatus::kRefused;
  Pose X_BT_wanted = Pose::Identity();
  Pose X_BT_commanded = Pose::Identity();  ///< what to command so that the tool lands on the pose that was wanted
  JointVector q;                           ///< the controller's joints for it (nominal inverse kinematics), rad
  double error_before = kNothingToSay;     ///< m, to expect without correction
  double error_after = kNothingToSay;      ///< m, to expect with it; left alone, the same as before
  double stddev = kNothingToSay;           ///< m, of the true position reached, per axis: root mean square of the three
  double left = 0;                         ///< m, what the iteration left; part of error_after
  int iterations = 0;
  std::string message;  ///< why not ok

  static constexpr double kNothingToSay = std::numeric_limits<double>::quiet_NaN();
};

struct CorrectOptions {
  double tolerance = 1e-7;  ///< m, last step (1e-4 mm)
  int max_iterations = 10;
};

/// A batch on which some sources of a finished model were identified anew.
struct RefitRecord {
  std::string model;                 ///< id of the model that it started from
  std::vector<std::string> sources;  ///< as they were named
  std::string batch_id;
  std::string batch_hash;
  int poses = 0;
};

/// Where a model comes from. What was identified anew since then is told by `refits`, the last one last.
struct ModelProvenance {
  std::string id;     ///< first 12 characters of the hash
  std::string hash;   ///< SHA-256 of the model's content
  std::string level;  ///< source names joined by commas
  std::string batch_id;
  std::string batch_hash;       ///< of the batch text
  std::int64_t trained_at = 0;  ///< Unix time, s
  /// Unix time, s, of the newest measurement that it was made from; empty where nobody recorded it.
  std::optional<std::int64_t> measured_at;
  int training_poses = 0;
  std::uint64_t seed = 0;
  std::string program_version;
  std::vector<RefitRecord> refits;

  /// The batch that the model's figures are of: the last one.
  [[nodiscard]] const std::string& figures_batch_id() const {
    return refits.empty() ? batch_id : refits.back().batch_id;
  }
};

/// nominal chain + error sources (identified) + bias (learned): what a cell is served with. An immutable value, cheap
/// to copy, thread-safe.
class CompensatedModel {
 public:
  struct Parts {
    PhysicalModel physics;
    std::vector<IdentifiedParameter> parameters;
    std::vector<UnidentifiableCombination> unidentifiable;
    Eigen::MatrixXd covariance;  ///< of the parameters, SI
    int rank = 0;
    double condition_number = 0;
    double observability_index = 0;  ///< see CalibrationResult, as the next two
    std::vector<SuspectPose> suspects;
    std::vector<double> cost_record;
    double discrepancy = 0;                  ///< m per axis, see CalibrationResult
    std::optional<BiasChoice> bias_choice;   ///< of `auto`: what was asked and what it is worth
    std::optional<BiasState> bias;           ///< without features: they follow from the physics and bias_contexts
    std::optional<BiasState> rotation_bias;  ///< of the same poses: residual rotation vectors in B and sigma, rad
    /// Of a bias that was kept while sources were identified anew: the physics that it was learned beside, with all the
    /// parameters that a block of it knew, and P x P, SI, what is uncertain of the model's parameters beyond what the
    /// bias knows: what was identified since.
    struct BiasOrigin {
      PhysicalModel physics;
      Eigen::MatrixXd covariance;
    };
    std::optional<BiasOrigin> bias_origin;
    int oriented_poses = 0;                  ///< where only some poses of a bias had an orientation: none is learned
    std::vector<PoseContext> bias_contexts;  ///< of the bias' observations, in their order; empty without blocks
    std::optional<double> temperature_mean;  ///< degrees Celsius, of the training poses; empty where none was recorded
    double temperature_stddev = 0;           ///< K
    JointVector q_min, q_max;                ///< range of the training poses, rad
    JointVector extrapolation_slope;         ///< see Domain::growth(); empty in models of before it was learned
    double prior_share_limit = 0;            ///< in domain: prior share not above this
    std::set<std::pair<std::string, std::string>> trained_with;  ///< tool and payload of each training pose
    ModelProvenance provenance;                                  ///< id and hash are filled in by make()
    Evaluation training;                                         ///< on the poses it was trained on
    std::optional<Evaluation> validation;                        ///< on poses held out from training
  };
  [[nodiscard]] static Result<CompensatedModel> make(Parts parts);

  [[nodiscard]] const Parts& parts() const { return inside_->parts; }
  [[nodiscard]] const Cell& cell() const { return *inside_->parts.physics.cell; }
  [[nodiscard]] const ModelProvenance& provenance() const { return inside_->parts.provenance; }

  /// Refuses a tool with a payload that no training pose had: what was learned holds for no other, and a tool whose
  /// pose the data had to tell is known by no other.
  [[nodiscard]] Status check_trained_with(const std::string& tool, const std::string& payload) const;
  /// q is checked by the caller for size; tool and payload as resolve_tool() gives them.
  [[nodiscard]] ErrorPrediction predict(const JointVector& q, const std::string& tool,
                                        const std::string& payload) const;
  /// The same at many poses: in less time where the bias has blocks.
  [[nodiscard]] std::vector<ErrorPrediction> predict_all(const std::vector<PoseContext>& poses) const;
  /// What the bias was told of the arm while it was learned.
  [[nodiscard]] BiasPhysics learned_physics() const;
  /// The learned bias, if any, and what it is told of a pose where it asks for features.
  [[nodiscard]] const std::optional<BiasModel>& bias() const { return inside_->bias; }
  [[nodiscard]] BiasFeatures features(const PoseContext& context) const { return inside_->bias_physics.at(context); }
  /// Target correction, source section 3.4.1.
  [[nodiscard]] Correction correct(const Target& target, const std::string& tool, const std::string& payload,
                                   const CorrectOptions& options = {}) const;
  /// Measured - predicted of every pose, 3 x N, m, in B, at the three levels.
  struct LevelErrors {
    Eigen::Matrix3Xd nominal, calibrated, compensated;
    Eigen::Matrix3Xd stddev;  ///< expected of compensated
    std::vector<bool> in_domain;
    /// The same of the orientations of those poses that have one, rotation vectors, rad; stddev 3 x 0 where none was
    /// learned.
    struct Rotations {
      Eigen::Matrix3Xd nominal, calibrated, compensated, stddev;
    };
    Rotations rotation = {};
  };
  [[nodiscard]] LevelErrors errors_B(const MeasurementBatch& batch) const;
  /// Measured against predicted, pose by pose; the batch is checked against the cell and not empty. Poses of another
  /// batch than the model's own are met as served: what began at a pose has happened, what the tracker did does not
  /// count.
  [[nodiscard]] Evaluation evaluate(const MeasurementBatch& batch) const;

 private:
  struct Inside {
    explicit Inside(BiasPhysics physics) : bias_physics(std::move(physics)) {}
    Parts parts;
    BiasPhysics bias_physics;
    std::optional<BiasModel> bias;
    std::optional<BiasModel> rotation_bias;
    bool bias_has_parameters = false;
    std::optional<Matrix3> bias_turn;                // of a bias with an origin, BiasPhysics::turn_to()
    Vector3 bias_size_B = Vector3::Zero();           // m, rms over the training poses; 0 with blocks
    Vector3 rotation_bias_size_B = Vector3::Zero();  // rad, likewise; 0 with the block `parameters`
  };
  /// What the biases say at a pose.
  struct Learned {
    BiasPrediction position;
    std::optional<BiasPrediction> rotation;
  };
  /// With the temperature to take where nobody says it.
  [[nodiscard]] PoseContext completed(PoseContext asked) const;
  /// `bias_weight`: to take instead of what the pose's place in the domain says.
  [[nodiscard]] ErrorPrediction predict(const PoseContext& asked, std::optional<double> bias_weight) const;
  [[nodiscard]] ErrorPrediction predict(const PoseContext& asked, const Learned* learned,
                                        std::optional<double> bias_weight) const;
  [[nodiscard]] std::vector<Learned> learned(const std::vector<PoseContext>& poses) const;
  /// As it was learned, in B of today.
  [[nodiscard]] std::vector<Learned> turn(std::vector<Learned> all) const;
  /// X_BT as predict() expects it, and nothing else.
  [[nodiscard]] Pose pose_B(const PoseContext& asked, double bias_weight) const;
  /// Covariance of the position, in B, from what nobody said and a source wants to know: from which side a joint is
  /// approached, how warm the arm is.
  [[nodiscard]] Matrix3 covariance_of_unsaid(const PoseContext& context, bool temperature_unsaid,
                                             const Vector3& p_B) const;
  /// The joints that the controller goes to for a target as it stands.
  [[nodiscard]] Result<InverseResult> nominal_joints(const Target& target, const Pose& X_TF) const;
  /// How far the iteration came from the nominal joints to those that bring the tool where it is wanted.
  struct Approach {
    Pose X_BT_commanded;
    InverseResult joints;  ///< the last ones asked for; not kOk: it ended there
    Vector6 missing;       ///< of the pose wanted: m, rad
    int iterations = 0;
    bool settled = false;
  };
  /// From the joints in `context`, where the tool is predicted to be at `X_BT_predicted`.
  [[nodiscard]] Approach approach(const Pose& X_BT_wanted, PoseContext context, const Pose& X_BT_predicted,
                                  double bias_weight, const CorrectOptions& options) const;
  /// The other branches (conf) on which the target can be corrected; none where the arm's have no numbers.
  [[nodiscard]] std::vector<int> branches_that_reach(const Target& asked, const Pose& X_BT_wanted, PoseContext context,
                                                     const CorrectOptions& options) const;
  void add_rotations(const MeasurementBatch& batch, const std::vector<PoseContext>& poses,
                     const std::vector<ErrorPrediction>& predictions, LevelErrors* errors) const;
  [[nodiscard]] bool is_own(const MeasurementBatch& batch) const;
  explicit CompensatedModel(std::shared_ptr<const Inside> inside) : inside_(std::move(inside)) {}
  std::shared_ptr<const Inside> inside_;
};

/// The model as text (JSON, one object) and back. Refuses a text that is no model or whose hash does not fit its
/// content. The hash covers what the model is, not when it was made: same data, same seed, same id.
[[nodiscard]] std::string serialize(const CompensatedModel& model);
[[nodiscard]] Result<CompensatedModel> deserialize(const std::string& text, const std::string& where);
[[nodiscard]] Result<CompensatedModel> load_model(const std::string& path);

}  // namespace trammel
