#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/calibrate/maps/linear_arm.h"
#include "server/error_sources/joint_map.h"
#include "server/numerics/bfgs.h"

/// The likelihood of a batch under spectra of the joints' maps, with all parameters integrated out
/// to first order.
namespace trammel {

/// A map among the parameters of a model: sine and cosine of harmonic 1, 2, ... from `first` on.
struct MapColumns {
  Eigen::Index first = 0;
  int harmonics = 0;
};

/// The logarithms: three per map (rms of the map in rad, knee, power), then one per kind of
/// equation, the factor on its squared residuals relative to their sigmas. All have wide normal
/// priors.
class MapEvidence {
 public:
  /// The arm has the maps at any values; all other parameters are held to their priors about their
  /// present values.
  MapEvidence(const LinearArm& arm, std::vector<MapColumns> maps);

  [[nodiscard]] Eigen::VectorXd start() const;
  /// Negative log of evidence and prior, nat, up to a constant. False where it is no number.
  bool operator()(const Eigen::VectorXd& logs, ObjectiveValue* out) const;
  /// The most probable parameters and their covariance, in units of their scales.
  struct Posterior {
    Eigen::VectorXd x;
    Eigen::MatrixXd covariance;
  };
  [[nodiscard]] Posterior posterior(const Eigen::VectorXd& logs) const;
  /// The spectrum of map number `map`, with one harmonic for each of its pairs of columns.
  [[nodiscard]] MapSpectrum spectrum(const Eigen::VectorXd& logs, std::size_t map) const;
  /// The factors for the sigmas of each kind.
  [[nodiscard]] std::array<double, 2> noise(const Eigen::VectorXd& logs) const;

 private:
  struct Solved;
  [[nodiscard]] std::optional<Solved> solved(const Eigen::VectorXd& logs) const;
  [[nodiscard]] Eigen::VectorXd prior_variance(const Eigen::VectorXd& logs) const;
  void add_slopes_of_maps(const Eigen::VectorXd& logs, const Solved& at,
                          Eigen::VectorXd& gradient) const;

  const LinearArm& arm_;
  std::vector<MapColumns> maps_;
  Eigen::VectorXd from_prior_;  ///< P: the mean of the prior less the present value
};

}  // namespace trammel
