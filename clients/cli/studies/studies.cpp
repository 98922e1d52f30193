#include "clients/cli/studies/studies.h"

#include <algorithm>
#include <set>
#include <tuple>

#include "server/base/units.h"
#include "server/compensate/exchanged.h"
#include "server/plan/plan.h"
#include "server/robot/inverse_kinematics.h"
#include "server/tasks/train/leftover.h"
#include "server/tasks/train/train.h"

namespace trammel::cli {

namespace {

constexpr int kFolds = 7;
const std::set<int> kFoldsLeftOut = {1, 6};  // by Table 7.2
const std::vector<std::string> kLevels = {"M0", "M1", "M2", "M3"};
const std::string kTraining = "training";
const std::string kValidation = "validation";

// Independent draws of one seed.
constexpr std::uint64_t kCalibrationDraw = 0;
constexpr std::uint64_t kFullRangeValidationDraw = 1;
constexpr std::uint64_t kTrainingDraw = 2;
constexpr std::uint64_t kValidationDraw = 3;
constexpr std::uint64_t kHolesDraw = 4;
constexpr std::uint64_t kTrainingSizesDraw = 8;      // and the next, one for each size
constexpr std::uint64_t kCalibrationSizesDraw = 16;  // likewise

/// The virtual robot with its tracker, and the way from measurements to models.
class Laboratory {
 public:
  Laboratory(const VirtualRobot& robot, const StudyOptions& options, int steps)
      : robot_(robot), options_(options), steps_(steps) {}

  const VirtualRobot& robot() const { return robot_; }
  const std::shared_ptr<const Cell>& cell() const { return robot_.truth.cell; }

  Result<MeasurementBatch> measure(const Eigen::MatrixXd& q, std::uint64_t draw,
                                   const std::string& id) const {
    SimulateOptions simulate_options;
    simulate_options.seed = seed_of(draw, 1);
    return simulate(robot_, q, simulate_options).map([&](MeasurementBatch batch) {
      batch.id = id;
      return batch;
    });
  }
  /// Poses of a Latin hypercube.
  Result<MeasurementBatch> measure(const RangesDeg& ranges_deg, int count, std::uint64_t draw,
                                   const std::string& id) const {
    JointRanges ranges;
    for (const auto& [lower, upper] : ranges_deg)
      ranges.emplace_back(from_deg(lower), from_deg(upper));
    return measure(latin_hypercube(ranges, count, seed_of(draw, 0)), draw, id);
  }

  Result<CompensatedModel> calibrate(const std::string& level, const MeasurementBatch& batch) {
    TrainOptions train_options = options("calibrating " + level);
    train_options.level = level;
    train_options.bias = "none";
    return check_against_cell(batch, *cell()).and_then([&](const CheckedBatch& checked) {
      return train(cell(), checked, train_options);
    });
  }
  Result<CompensatedModel> learn(const std::string& level, const CompensatedModel& calibrated,
                                 const MeasurementBatch& batch) {
    const std::string stage =
        fmt::format("learning what {} leaves over of {} poses", level, batch.measurements.size());
    TrainOptions train_options = options(stage);
    train_options.bias = options_.bias;
    return check_against_cell(batch, *cell()).and_then([&](const CheckedBatch& checked) {
      return learn_bias(calibrated, checked, train_options);
    });
  }

 private:
  std::uint64_t seed_of(std::uint64_t draw, std::uint64_t part) const {
    return 64 * options_.seed + 2 * draw + part;
  }
  /// The options of the next step of work.
  TrainOptions options(const std::string& stage) {
    TrainOptions train_options;
    train_options.seed = options_.seed;
    train_options.progress = [this, stage, step = step_++](const std::string&, double share) {
      return !options_.progress || options_.progress(stage, (step + share) / steps_);
    };
    return train_options;
  }

  const VirtualRobot& robot_;
  const StudyOptions& options_;
  int steps_;
  int step_ = 0;
};

void add_calibrated(const std::string& level, const CompensatedModel& model, const std::string& set,
                    const MeasurementBatch& batch, Study& study) {
  const BiasProblem error = leftover(model.parts().physics, batch);
  study.rows.push_back({.set = set,
                        .model = level,
                        .training_poses = model.provenance().training_poses,
                        .poses = static_cast<int>(batch.measurements.size()),
                        .figures = figures_of(error.residual_B.transpose())});
}

/// The remaining error if the bias is applied at every pose, inside the domain or not. 3 x N, m.
Eigen::Matrix3Xd left_by_bias(const CompensatedModel& model, const MeasurementBatch& batch) {
  const BiasProblem error = leftover(model.parts().physics, batch);
  if (!model.bias()) return error.residual_B.transpose();  // none helped
  const BiasModel& bias = *model.bias();
  std::vector<BiasFeatures> features;
  for (const Measurement& m : batch.measurements) {
    if (bias.needs_features()) features.push_back(model.features(m.context));
  }
  return (error.residual_B - bias.mean_all_B(error.q, features)).transpose();
}

void add_learned(const std::string& level, const CompensatedModel& model, const std::string& set,
                 const MeasurementBatch& batch, Study& study) {
  study.rows.push_back({.set = set,
                        .model = level + "+GP",
                        .training_poses = model.provenance().training_poses,
                        .poses = static_cast<int>(batch.measurements.size()),
                        .figures = figures_of(left_by_bias(model, batch)),
                        .served = model.evaluate(batch),
                        .bias_left_out = !model.bias()});
}

/// Adds the true parameters beside those of `model`.
void add_parameters(const std::string& level, const CompensatedModel& model, Study& study) {
  for (const IdentifiedParameter& identified : model.parts().parameters) {
    const auto known =
        std::find_if(study.parameters.begin(), study.parameters.end(),
                     [&](const StudyParameter& p) { return p.name == identified.parameter.name; });
    if (known != study.parameters.end()) known->identified.emplace(level, identified);
  }
}

std::vector<StudyParameter> true_parameters(const PhysicalModel& truth) {
  std::vector<StudyParameter> parameters;
  Eigen::Index k = 0;
  for (const Parameter& parameter : truth.parameters()) {
    parameters.push_back({.name = parameter.name,
                          .unit = parameter.unit,
                          .truth = parameter.scale * truth.values(k++)});
  }
  return parameters;
}

Status run_calibration_study(Laboratory& laboratory, Study& study) {
  const auto training = TRY(
      laboratory.measure(kCalibrationRanges, kCalibrationPoses, kCalibrationDraw, "calibration"));
  const auto validation = TRY(laboratory.measure(kCalibrationRanges, kValidationPoses,
                                                 kFullRangeValidationDraw, "validation"));
  study.parameters = true_parameters(laboratory.robot().truth);
  for (const std::string& level : kLevels) {
    const CompensatedModel model = TRY(laboratory.calibrate(level, training));
    add_calibrated(level, model, kTraining, training, study);
    add_calibrated(level, model, kValidation, validation, study);
    add_parameters(level, model, study);
  }
  return {};
}

Status run_bias_study(Laboratory& laboratory, const BiasStudy& spec, Study& study) {
  const auto calibration = TRY(
      laboratory.measure(kCalibrationRanges, kCalibrationPoses, kCalibrationDraw, "calibration"));
  const auto training =
      TRY(laboratory.measure(spec.ranges, spec.training_poses, kTrainingDraw, study.name));
  const auto validation =
      TRY(laboratory.measure(spec.ranges, kValidationPoses, kValidationDraw, "validation"));
  for (const std::string& level : kLevels) {
    const CompensatedModel calibrated = TRY(laboratory.calibrate(level, calibration));
    const CompensatedModel learned = TRY(laboratory.learn(level, calibrated, training));
    for (const auto& [set, batch] :
         {std::pair{kTraining, &training}, std::pair{kValidation, &validation}}) {
      add_calibrated(level, calibrated, set, *batch, study);
      add_learned(level, learned, set, *batch, study);
    }
  }
  return {};
}

/// Runs the study of the learned bias' convergence with the number of training poses.
Status run_training_sizes(Laboratory& laboratory, const std::vector<std::string>& levels,
                          Study& study) {
  const RangesDeg& ranges = kBiasStudies.back().ranges;
  const auto calibration = TRY(
      laboratory.measure(kCalibrationRanges, kCalibrationPoses, kCalibrationDraw, "calibration"));
  const auto validation =
      TRY(laboratory.measure(ranges, kValidationPoses, kValidationDraw, "validation"));
  for (const std::string& level : levels) {
    const CompensatedModel calibrated = TRY(laboratory.calibrate(level, calibration));
    add_calibrated(level, calibrated, kValidation, validation, study);
    for (std::size_t k = 0; k < kTrainingSizes.size(); ++k) {
      const auto training =
          TRY(laboratory.measure(ranges, kTrainingSizes[k], kTrainingSizesDraw + k, "training"));
      const CompensatedModel learned = TRY(laboratory.learn(level, calibrated, training));
      add_learned(level, learned, kValidation, validation, study);
    }
  }
  return {};
}

/// Runs the study of the complete physical model's convergence with the number of poses.
Status run_calibration_sizes(Laboratory& laboratory, const std::string& level, Study& study) {
  const auto validation = TRY(laboratory.measure(kCalibrationRanges, kValidationPoses,
                                                 kFullRangeValidationDraw, "validation"));
  for (std::size_t k = 0; k < kCalibrationSizes.size(); ++k) {
    const auto training = TRY(laboratory.measure(kCalibrationRanges, kCalibrationSizes[k],
                                                 kCalibrationSizesDraw + k, "calibration"));
    const CompensatedModel model = TRY(laboratory.calibrate(level, training));
    add_calibrated(level, model, "validation, full range", validation, study);
  }
  return {};
}

Status run_quantity_study(Laboratory& laboratory, Study& study) {
  const Status trained = run_training_sizes(laboratory, {"M0", "M2", "M3"}, study);
  return trained ? run_calibration_sizes(laboratory, "M3", study) : trained;
}

/// The joints to which the controller moves for a target.
Result<InverseResult> nominal_joints(const Cell& cell, const Pose& X_FT, const Target& target) {
  if (target.joint_target) return InverseResult{InverseStatus::kOk, *target.seed};
  const Pose X_BF = target.X_BT * X_FT.inverse();
  if (target.conf) return inverse_kinematics(cell.robot, X_BF, *target.conf, target.seed);
  return inverse_kinematics(cell.robot, X_BF, *target.seed);
}

/// The nominal joints of every hole, in the file's order.
Result<Eigen::MatrixXd> nominal_joints(const Cell& cell, const Pose& X_FT,
                                       const std::vector<TargetRow>& holes) {
  Eigen::MatrixXd q(static_cast<Eigen::Index>(holes.size()), cell.robot.size());
  for (std::size_t i = 0; i < holes.size(); ++i) {
    const InverseResult joints =
        TRY(nominal_joints(cell, X_FT, target_of(holes[i].target, cell.robot)));
    if (joints.status != InverseStatus::kOk) {
      return refused("cell {} does not reach it", cell.name).in("holes").at_row(holes[i].row);
    }
    q.row(static_cast<Eigen::Index>(i)) = joints.q.transpose();
  }
  return q;
}

MeasurementBatch part_of(const MeasurementBatch& batch,
                         const std::function<bool(std::size_t)>& chosen) {
  MeasurementBatch part = batch;
  part.measurements.clear();
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    if (chosen(i)) part.measurements.push_back(batch.measurements[i]);
  }
  return part;
}

/// Errors of several sets of poses, one set after the other.
class PooledErrors {
 public:
  void add(const Eigen::Matrix3Xd& calibrated, const Eigen::Matrix3Xd& learned) {
    append(calibrated, calibrated_);
    append(learned, learned_);
  }
  void add_rows(const std::string& set, int training_poses, Study& study) const {
    const int poses = static_cast<int>(calibrated_.cols());
    const auto add = [&](const char* model, const Eigen::Matrix3Xd& errors) {
      study.rows.push_back({.set = set,
                            .model = model,
                            .training_poses = training_poses,
                            .poses = poses,
                            .figures = figures_of(errors)});
    };
    add("M0", calibrated_);
    add("M0+GP", learned_);
  }

 private:
  static void append(const Eigen::Matrix3Xd& more, Eigen::Matrix3Xd& errors) {
    const Eigen::Index before = errors.cols();
    errors.conservativeResize(3, before + more.cols());
    errors.rightCols(more.cols()) = more;
  }
  Eigen::Matrix3Xd calibrated_, learned_;
};

/// Every hole is held out once, Tables 7.1 and 7.2.
Status cross_validate(Laboratory& laboratory, const CompensatedModel& nominal,
                      const MeasurementBatch& holes, Study& study) {
  PooledErrors training_errors, validation_errors, training_without, validation_without;
  int training_poses = 0;
  for (int fold = 1; fold <= kFolds; ++fold) {
    const auto held_out = [&](std::size_t i) { return static_cast<int>(i % kFolds) + 1 == fold; };
    const MeasurementBatch training = part_of(holes, [&](std::size_t i) { return !held_out(i); });
    const MeasurementBatch validation = part_of(holes, held_out);
    const CompensatedModel learned = TRY(laboratory.learn("M0", nominal, training));
    training_poses = static_cast<int>(training.measurements.size());
    const bool without = !kFoldsLeftOut.contains(fold);
    for (const auto& [batch, all, some] :
         {std::tuple{&training, &training_errors, &training_without},
          std::tuple{&validation, &validation_errors, &validation_without}}) {
      const Eigen::Matrix3Xd calibrated =
          leftover(nominal.parts().physics, *batch).residual_B.transpose();
      const Eigen::Matrix3Xd left = left_by_bias(learned, *batch);
      all->add(calibrated, left);
      if (without) some->add(calibrated, left);
    }
  }
  training_errors.add_rows(kTraining, training_poses, study);
  validation_errors.add_rows(kValidation, training_poses, study);
  training_without.add_rows(kTraining + " without k = 1, 6", training_poses, study);
  validation_without.add_rows(kValidation + " without k = 1, 6", training_poses, study);
  return {};
}

/// Drills at the model's corrected places. `measured`: the same holes as measured without
/// correction.
void drill(const VirtualRobot& robot, const std::string& name, const CompensatedModel& model,
           const std::vector<TargetRow>& holes, const MeasurementBatch& measured, Study& study) {
  const Pose X_BW = robot.truth.X_WB.inverse();
  for (std::size_t i = 0; i < holes.size(); ++i) {
    PoseContext context = measured.measurements[i].context;
    const Correction correction = model.correct(target_of(holes[i].target, model.cell().robot),
                                                context.tool, context.payload);
    const auto true_error = [&](const JointVector& q) {
      context.q = q;
      return ((X_BW * robot.truth.pose_W(context)).translation() -
              correction.X_BT_wanted.translation())
          .norm();
    };
    // A hole that is left alone is drilled at the uncorrected place.
    const JointVector uncorrected = context.q;
    const bool corrected = correction.status == CorrectionStatus::kOk ||
                           correction.status == CorrectionStatus::kOutOfDomain;
    study.holes.push_back({.row = holes[i].row,
                           .model = name,
                           .status = correction.status,
                           .error_before = true_error(uncorrected),
                           .error_after = true_error(corrected ? correction.q : uncorrected),
                           .expected_after = correction.error_after});
  }
}

Status run_drilling_study(Laboratory& laboratory, const std::vector<TargetRow>& holes,
                          Study& study) {
  const Cell& cell = *laboratory.cell();
  const std::string tool = TRY(resolve_tool(cell, ""));
  const Eigen::MatrixXd q =
      TRY(nominal_joints(cell, laboratory.robot().truth.tools.at(tool), holes));
  const auto measured = TRY(laboratory.measure(q, kHolesDraw, "holes"));
  const auto calibration = TRY(
      laboratory.measure(kCalibrationRanges, kCalibrationPoses, kCalibrationDraw, "calibration"));
  for (const std::string level : {"M0", "M3"}) {
    const CompensatedModel calibrated = TRY(laboratory.calibrate(level, calibration));
    if (level == "M0") {
      const Status validated = cross_validate(laboratory, calibrated, measured, study);
      if (!validated) return validated;
    }
    const CompensatedModel learned = TRY(laboratory.learn(level, calibrated, measured));
    drill(laboratory.robot(), level + "+GP", learned, holes, measured, study);
  }
  return {};
}

/// Trainings of a study, for its progress.
int steps_of(const std::string& name) {
  if (name == "cal") return static_cast<int>(kLevels.size());
  if (name == "drilling") return kFolds + 4;
  if (name == "quantity")
    return static_cast<int>(3 * (1 + kTrainingSizes.size()) + kCalibrationSizes.size());
  return static_cast<int>(2 * kLevels.size());
}

}  // namespace

const std::vector<std::string>& study_names() {
  static const std::vector<std::string> names = {"cal",    "1dim",     "3dim",    "6dim-s",
                                                 "6dim-l", "drilling", "quantity"};
  return names;
}

Result<Study> run_study(const std::string& name, const VirtualRobot& robot,
                        const StudyOptions& options) {
  const Cell& cell = *robot.truth.cell;
  if (cell.robot.size() != static_cast<int>(kCalibrationRanges.size())) {
    return refused("cell {}: a robot of {} joints, the studies are of {}", cell.name,
                   cell.robot.size(), kCalibrationRanges.size())
        .of("joints")
        .beyond(cell.robot.size(), kCalibrationRanges.size());
  }
  Study study;
  study.name = name;
  study.seed = options.seed;
  study.cell = cell.name;
  Laboratory laboratory(robot, options, steps_of(name));
  const auto bias_study = std::find_if(kBiasStudies.begin(), kBiasStudies.end(),
                                       [&](const BiasStudy& spec) { return spec.name == name; });
  TRY([&]() -> Status {
    if (bias_study != kBiasStudies.end()) return run_bias_study(laboratory, *bias_study, study);
    if (name == "cal") return run_calibration_study(laboratory, study);
    if (name == "drilling") return run_drilling_study(laboratory, options.holes, study);
    if (name == "quantity") return run_quantity_study(laboratory, study);
    return failure(ErrorCode::kUsage, "study '{}' is unknown", name)
        .of("study")
        .with_text(name)
        .next(fmt::format("known are {}", fmt::join(study_names(), ", ")));
  }());
  return study;
}

}  // namespace trammel::cli
