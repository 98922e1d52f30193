#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/bias/bias_data.h"
#include "server/bias/choose_bias.h"
#include "server/calibrate/calibration.h"
#include "server/calibrate/causes/cause_choice.h"
#include "server/calibrate/changes.h"
#include "server/compensate/budget/budget.h"
#include "server/compensate/evaluation.h"
#include "server/compensate/what_was_measured.h"

namespace trammel {

/// The sources of a finished model that were identified anew.
struct RefitRecord {
  std::string model;                 ///< id of the model that it started from
  std::vector<std::string> sources;  ///< in the caller's spelling
  std::string batch_id;
  std::string batch_hash;
  int poses = 0;
};

/// The origin of a model. `refits` lists the later identifications since its training, in their
/// order.
struct ModelProvenance {
  std::string id;     ///< first 12 characters of the hash
  std::string hash;   ///< SHA-256 of the model's content
  std::string level;  ///< source names joined by commas
  std::string batch_id;
  std::string batch_hash;       ///< of the batch text
  std::int64_t trained_at = 0;  ///< Unix time, s
  /// Unix time, s, of the newest measurement in it; empty where no time was recorded.
  std::optional<std::int64_t> measured_at;
  int training_poses = 0;
  std::uint64_t seed = 0;
  std::string program_version;
  std::vector<RefitRecord> refits;

  /// The batch that the model's figures are of: the last.
  [[nodiscard]] const std::string& figures_batch_id() const {
    return refits.empty() ? batch_id : refits.back().batch_id;
  }
};

/// A session that nothing was learned from.
struct LeftOutSession {
  std::string id;
  std::string why;
};

/// All parts of a model, and all contents of its file.
struct ModelParts {
  PhysicalModel physics;
  std::vector<IdentifiedParameter> parameters;
  std::vector<UnidentifiableCombination> unidentifiable;
  Eigen::MatrixXd covariance;  ///< of the parameters, SI
  int rank = 0;
  double condition_number = 0;
  double observability_index = 0;  ///< see CalibrationResult, as the next two
  std::vector<SuspectPose> suspects;
  std::vector<double> cost_record;
  /// The settings of several sessions, the newest last, in whose world the base stands;
  /// empty: there was one.
  std::vector<SessionSetting> sessions;
  bool sessions_as_given =
      false;  ///< false: no clock gave their order, so they are in the given one
  std::vector<LeftOutSession> sessions_left_out;
  std::vector<Change>
      changes;             ///< of the arm between these sessions; the physics has their sources
  double discrepancy = 0;  ///< m per axis, see CalibrationResult
  std::optional<CauseChoice>
      cause_choice;                       ///< with error sources `auto`: the trials and their gains
  std::optional<BiasChoice> bias_choice;  ///< with bias `auto`: the trials and their gains
  std::optional<BiasState>
      bias;  ///< without features, which follow from the physics and bias_contexts
  std::optional<BiasState>
      rotation_bias;  ///< at the same poses: residuals are rotation vectors in B, rad
  /// The origin of a bias that was kept while sources were identified anew. `physics` is the one
  /// beside which it was learned, with all the parameters that its blocks knew. `covariance` (P x
  /// P, SI) is that of the parameters identified since, which the bias does not know.
  struct BiasOrigin {
    PhysicalModel physics;
    Eigen::MatrixXd covariance;
  };
  std::optional<BiasOrigin> bias_origin;
  int oriented_poses =
      0;  ///< the number of poses with an orientation, if too few had one to learn from
  std::vector<PoseContext> bias_contexts;  ///< of the bias' observations; empty without blocks
  std::optional<double>
      temperature_mean;  ///< degrees Celsius, of the training poses; empty where not recorded
  double temperature_stddev = 0;  ///< K
  JointVector q_min, q_max;       ///< range of the training poses, rad
  std::optional<WhatWasMeasured>
      measured;  ///< of the training poses; empty in models from before it was recorded
  JointVector
      extrapolation_slope;  ///< see Domain::growth(); empty in models from before it was learned
  double prior_share_limit = 0;  ///< a pose in domain has no larger prior share
  double bias_spread =
      1;  ///< factor on the standard deviation of a pose's error, without the instrument's part
  std::set<std::pair<std::string, std::string>>
      trained_with;                      ///< tool and payload of each training pose
  ModelProvenance provenance;            ///< id and hash are filled in by make()
  Evaluation training;                   ///< on its training poses
  std::optional<Evaluation> validation;  ///< on poses held out from training
  std::optional<ErrorBudget> budget;     ///< at the training poses; empty if they allow none
};

}  // namespace trammel
