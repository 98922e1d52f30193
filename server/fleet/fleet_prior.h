#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// The common parameters of robots of one type, learned from the models of trained robots.
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
  int robots = 0;     ///< the number of robots that showed it
  /// Standard deviation of the next robot's value, for normal robots, including the uncertainty of
  /// the mean. The spread is the scale of Student's t with four degrees of freedom, which is
  /// smaller than that of normal values by sqrt(1.45), and few robots underestimate it. Compare
  /// with Student's t with `robots - 1` degrees of freedom, since few robots hardly determine their
  /// spread.
  [[nodiscard]] double next_stddev() const;
};

struct FleetPrior {
  std::string robot;  ///< the type's name
  int robots = 0;
  std::vector<FleetParameter> parameters;
  Eigen::MatrixXd correlation;  ///< of the parameters from robot to robot, shrunk towards none
  [[nodiscard]] const FleetParameter* find(const std::string& name) const;
};

/// Fewer robots show no spread.
inline constexpr int kFewestTwins = 3;

/// True if both cells have robots of one type: the same drawing.
[[nodiscard]] bool same_type(const Chain& one, const Chain& other);

/// The model: robot r has parameters theta_r ~ N(mean, spread²). Each parameter's deviations have
/// Student's tails (four degrees of freedom, as a scale mixture), so that one odd robot does not
/// widen the spread. Its poses say theta_r ~ N(m_r, L_r⁻¹), where the prior of its own training is
/// removed. Mean and spread come from expectation maximisation. The spread of a parameter is shrunk
/// to that of its kind (lengths, angles, compliances, in units of the priors) as if three more
/// robots had it. Base, tools and payloads are excluded. Refuses fewer than kFewestTwins members of
/// the type of `robot`; members of another type are left out.
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
/// The unusual parameters of a robot, the most unusual first. A parameter is unusual if the robot's
/// own poses put it beyond the prediction interval of the fleet's next robot. Among fleets whose
/// robots follow one law, at most kFalseFleets have a parameter that is called unlike (Student's t,
/// Bonferroni over parameters and robots). `fleet` should be learned without this robot.
[[nodiscard]] std::vector<Unlike> unlike_twins(const ModelParts& parts, const FleetPrior& fleet);
[[nodiscard]] std::vector<Unlike> unlike_twins(const std::vector<IdentifiedParameter>& parameters,
                                               const Eigen::MatrixXd& covariance,
                                               const FleetPrior& fleet);
inline constexpr double kFalseFleets = 0.05;
/// `C3 is 0.46 deg/kNm, its twins have 0.23 ± 0.02 (9.1 standard deviations)`.
[[nodiscard]] std::string to_string(const Unlike& unlike);

}  // namespace trammel
