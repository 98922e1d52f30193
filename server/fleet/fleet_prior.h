#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// The common parameters of robots of one type, learned from the models of those that were trained.
namespace trammel {

/// A robot of the fleet: its name for people, and its model.
struct FleetMember {
  std::string name;
  CompensatedModel model;
};

/// One parameter of the arm, over the robots of the fleet.
struct FleetParameter {
  std::string name;   ///< `C3`, `d4`
  double mean = 0;    ///< SI, over the robots
  double spread = 0;  ///< SI, standard deviation from robot to robot
  int robots = 0;     ///< that showed it
  /// Standard deviation of the next robot's value where robots are normal: the spread is the scale
  /// of Student's t with four degrees of freedom, which is sqrt(1.45) below that of normal values,
  /// and few robots make it smaller than it is; and what is uncertain of the mean. To be held
  /// against Student's t with `robots - 1` degrees of freedom: few robots hardly know their spread.
  [[nodiscard]] double next_stddev() const;
};

struct FleetPrior {
  std::string robot;  ///< the type's name
  int robots = 0;
  std::vector<FleetParameter> parameters;
  Eigen::MatrixXd correlation;  ///< of the parameters from robot to robot, shrunk towards none
  [[nodiscard]] const FleetParameter* find(const std::string& name) const;
};

/// Fewer robots say nothing of a spread.
inline constexpr int kFewestTwins = 3;

/// True if both cells have robots of one type: the same drawing.
[[nodiscard]] bool same_type(const Chain& one, const Chain& other);

/// The model: robot r's parameters theta_r ~ N(mean, spread²), each parameter's deviations with
/// Student's tails (four degrees of freedom, as a scale mixture), so that one odd robot does not
/// widen the spread; its poses say theta_r ~ N(m_r, L_r⁻¹), where the prior of its own training is
/// taken out again. Mean and spread by expectation maximisation; the spread of a parameter is drawn
/// to that of its kind (lengths, angles, compliances, in units of the priors) as if three more
/// robots had it. Base, tools and payloads are no part of it. Refuses fewer than kFewestTwins
/// members of the type of `robot`; members of another type are left out.
[[nodiscard]] Result<FleetPrior> learn_fleet_prior(const Chain& robot,
                                                   const std::vector<FleetMember>& members);

/// A parameter in which a robot is unlike its twins.
struct Unlike {
  std::string parameter;
  std::string unit;
  double value = 0, fleet_mean = 0,
         fleet_stddev = 0;  ///< in that unit; value: by its own poses alone
  double z = 0;             ///< standard deviations apart
};
/// The unusual parameters of a robot, the most unusual first: parameters that its own poses put
/// beyond the prediction interval of the fleet's next robot, so wide that of the fleets whose
/// robots are all of one law at most kFalseFleets have one that is called unlike (Student's t,
/// Bonferroni over parameters and robots). `fleet` should be learned without it.
[[nodiscard]] std::vector<Unlike> unlike_twins(const ModelParts& parts, const FleetPrior& fleet);
[[nodiscard]] std::vector<Unlike> unlike_twins(const std::vector<IdentifiedParameter>& parameters,
                                               const Eigen::MatrixXd& covariance,
                                               const FleetPrior& fleet);
inline constexpr double kFalseFleets = 0.05;
/// `C3 is 0.46 deg/kNm, its twins have 0.23 ± 0.02 (9.1 standard deviations)`.
[[nodiscard]] std::string to_string(const Unlike& unlike);

}  // namespace trammel
