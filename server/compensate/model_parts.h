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
  std::vector<std::string> sources;  ///< as they were named
  std::string batch_id;
  std::string batch_hash;
  int poses = 0;
};

/// Where a model comes from. `refits` tells what was identified anew since it was trained, in that
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

/// All that a model is made of, and all that its file holds.
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
      false;  ///< no clock told their order: they are in that in which they were given
  std::vector<LeftOutSession> sessions_left_out;
  std::vector<Change>
      changes;  ///< of the arm between these sessions; their sources are among those of the physics
  double discrepancy = 0;  ///< m per axis, see CalibrationResult
  std::optional<CauseChoice>
      cause_choice;  ///< where the error sources were `auto`: what was tried, and what it brought
  std::optional<BiasChoice>
      bias_choice;  ///< where the bias was `auto`: what was tried and what it is worth
  std::optional<BiasState>
      bias;  ///< without features, which follow from the physics and bias_contexts
  std::optional<BiasState>
      rotation_bias;  ///< of the same poses: residuals are rotation vectors in B, rad
  /// For a bias that was kept while sources were identified anew: the physics that it was learned
  /// beside, with all the parameters that its blocks knew; and P x P, SI, the covariance of the
  /// parameters identified since, which the bias does not know.
  struct BiasOrigin {
    PhysicalModel physics;
    Eigen::MatrixXd covariance;
  };
  std::optional<BiasOrigin> bias_origin;
  int oriented_poses =
      0;  ///< where only some poses had an orientation and none is learned: how many
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
      1;  ///< times the standard deviation of what a pose misses, the instrument's aside
  std::set<std::pair<std::string, std::string>>
      trained_with;                      ///< tool and payload of each training pose
  ModelProvenance provenance;            ///< id and hash are filled in by make()
  Evaluation training;                   ///< on its training poses
  std::optional<Evaluation> validation;  ///< on poses held out from training
  std::optional<ErrorBudget> budget;     ///< at the training poses; empty where they tell none
};

}  // namespace trammel
