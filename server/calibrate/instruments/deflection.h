#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/calibrate/instruments/deflection_list.h"

/// Stiffness by direct deflection, source section 4.2. Weights hung from the flange bend the arm in
/// its vertical plane. Reflectors along its elements (a joint and the link behind it) show the
/// deflection of each joint, and whether the link bends as well.
namespace trammel {

struct DeflectionOptions {
  double sigma = 13e-6;  ///< m, of one coordinate, where the file has none
  /// true: readings are against the ground and include the motion of inner elements, so all
  /// elements are solved together; false: each element's readings are free of the others' motion.
  bool chained = false;
  std::vector<int> load_bias = {};  ///< elements whose foot moves with the load: the B of eq. (4.4)
  std::vector<double> validation_loads =
      {};  ///< N; empty: the choice of the file, else every third load from the second on
};

/// One element under one model; intervals are U(k=2).
struct DeflectionFit {
  double compliance = 0;  ///< C, rad/Nm
  double compliance_u = 0;
  std::optional<double> flexibility;  ///< 1/EI, 1/(N m^2); model 1 only
  double flexibility_u = 0;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  ///< A, m
  Eigen::Vector2d offset_u = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> load_bias;  ///< B, m/Nm
  Eigen::Vector2d load_bias_u = Eigen::Vector2d::Zero();
  double rms_train = 0;       ///< m, |dp|
  double rms_validation = 0;  ///< m; 0 without validation loads
};

enum class LinkVerdict { kBends, kRigid, kCannotTell };

struct ElementResult {
  int element = 0;
  std::optional<DeflectionFit>
      beam;             ///< model 1, eq. (4.2); empty where the reflectors cannot show a beam
  DeflectionFit rigid;  ///< model 2, eq. (4.3)
  LinkVerdict verdict = LinkVerdict::kCannotTell;
  double f = 0;  ///< F of the beam term, 1 against `freedom` degrees of freedom
  double p_value = 1;
  double aic_gain = 0;     ///< AIC of the rigid link minus that of the beam
  double end_bending = 0;  ///< m, the beam's share at the link's end under the largest load
  double end_bending_u = 0;
  double load_bias_p_value =
      1;                 ///< p-value of no motion of the foot with the load; 1 if not tested
  std::string sentence;  ///< for people
};

struct DeflectionResult {
  std::vector<ElementResult> elements;
  std::vector<double> training_loads, validation_loads;  ///< N
  int freedom = 0;                                       ///< of the beam model
  double variance_factor = 1;  ///< residuals over stated sigma, squared, of the beam model
  double rms_still = 0;  ///< m, validation (or training) |dp| when nothing is predicted, Table 4.14
  double rms_beam = 0;   ///< m, of model 1
  double rms_rigid = 0;  ///< m, of model 2
};

/// Fits eqs. (4.2) to (4.6) by weighted linear least squares, since C, 1/EI, A and B enter
/// linearly. At the link's far end the load L makes the force w = L cos(theta) across the link and
/// the moment M = L lever; at the joint the moment is M_R = M + w length. The link is called a beam
/// if its term is positive, its F test gives p < 0.01 and AIC agrees. It is called rigid if a bend
/// of three sigma at its end would have been seen. Otherwise the data cannot tell. Where the
/// residuals exceed the stated sigma, they scale the uncertainties. Refuses fewer than two training
/// loads, too few readings, parameters that the readings do not separate, and a validation load or
/// an element that is not in the data.
[[nodiscard]] Result<DeflectionResult> fit_deflection(const DeflectionData& data,
                                                      const DeflectionOptions& options);

}  // namespace trammel
