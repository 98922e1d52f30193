#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/cli/files/target_file.h"
#include "clients/cli/studies/study_tables.h"
#include "server/compensate/compensated_model.h"
#include "server/simulate/simulate.h"

/// The studies of the source's chapters 5 and 7, repeated on a virtual robot.
namespace trammel::cli {

struct StudyOptions {
  std::uint64_t seed = 1;           ///< of all draws
  std::vector<TargetRow> holes;     ///< of the drilling study
  std::optional<std::string> bias;  ///< kernel to learn with instead of the cell's
  /// The step of work and the share done of all in [0, 1]; return false to give up.
  std::function<bool(const std::string& stage, double share)> progress;
};

/// The errors of one model on one set of poses.
struct StudyRow {
  std::string set;         ///< `training`, `validation`, ...
  std::string model;       ///< `M0` ... `M3`, `M0+GP` ...
  int training_poses = 0;  ///< poses from which the last part of the model was identified or
                           ///< learned
  int poses = 0;           ///< in the set
  ErrorFigures figures;    ///< with the learned bias applied at every pose, as the source does
  std::optional<Evaluation> served =
      {};  ///< of a learned bias: as answers are given, with the calibrated model off domain
  bool bias_left_out = false;  ///< `M3+GP` if no bias was worth it: the unchanged calibrated model
};

/// A parameter of the virtual robot and its values at each level, in the parameter's unit.
struct StudyParameter {
  std::string name, unit;
  double truth = 0;
  std::map<std::string, IdentifiedParameter> identified = {};  ///< by level
};

/// A hole that was drilled where a model's correction said.
struct DrilledHole {
  int row = 0;  ///< in the file of targets
  std::string model;
  CorrectionStatus status = CorrectionStatus::kRefused;
  double error_before = 0,
         error_after = 0;     ///< m, true distance from the wanted point, uncorrected and corrected
  double expected_after = 0;  ///< m, the model's expectation of error_after
};

struct Study {
  std::string name;
  std::uint64_t seed = 0;
  std::string cell;
  std::vector<StudyRow> rows;
  std::vector<StudyParameter> parameters;  ///< of `cal`
  std::vector<DrilledHole> holes;          ///< of `drilling`
};

/// As on the command line.
[[nodiscard]] const std::vector<std::string>& study_names();

/// The same robot, name and seed give the same study. Refuses an unknown name, a robot that does
/// not have six joints or cannot reach the ranges of the study, and holes out of reach.
[[nodiscard]] Result<Study> run_study(const std::string& name, const VirtualRobot& robot,
                                      const StudyOptions& options);

}  // namespace trammel::cli
