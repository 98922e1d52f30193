#pragma once

#include <Eigen/Dense>
#include <optional>

#include "server/robot/pose.h"

/// Figures of the differences between predictions and measurements.
namespace trammel {

/// Figures of the position errors |measured - predicted| of some poses, m.
struct ErrorFigures {
  double rms = 0, mean = 0, p997 = 0, max = 0;
  Vector3 axis_mean = Vector3::Zero(), axis_stddev = Vector3::Zero();  ///< in B
};
/// The figures without any position: none of them is a number.
[[nodiscard]] ErrorFigures no_figures();
/// For the errors in the columns of `e_B` (3 x N, m, not empty).
[[nodiscard]] ErrorFigures figures_of(const Eigen::Matrix3Xd& e_B);

/// Orientation errors of the poses with a measured orientation: rms of the rotation angle, rad.
struct OrientationFigures {
  int poses = 0;
  double nominal = 0, calibrated = 0, compensated = 0;
  std::optional<double> coverage_95;  ///< share of coordinates inside their 95 % interval; for
                                      ///< models that learned orientations
};

/// Errors of rows with one number (Gauge), m: measured - predicted value. They are not position
/// errors and are never compared with them.
struct GaugeFigures {
  int rows = 0;
  double nominal = 0, calibrated = 0, compensated = 0;  ///< rms
  double max = 0;                                       ///< of compensated, magnitude
  double coverage_95 = 0;  ///< share of rows inside their 95 % interval
  int in_domain = 0;
  std::optional<double> coverage_95_stated;  ///< as Evaluation::coverage_95_stated
};

/// The three levels of one model on the same poses.
struct Evaluation {
  int poses =
      0;  ///< with a position; 0: of gauges alone, and all figures of positions are not numbers
  ErrorFigures nominal, calibrated, compensated;
  double coverage_95 = 0;  ///< share of coordinates inside their 95 % interval
  int in_domain = 0;
  /// Mean over the coordinates of -log N(error; 0, stddev²), compensated, nat, positions in m; in
  /// mm it is 6.9 more (nlpd_in_mm()). Smaller is better: it rewards small errors and correct
  /// standard deviations. Empty if a standard deviation is 0, and in older models.
  std::optional<double> nlpd;
  std::optional<OrientationFigures> orientation;  ///< if orientations were measured
  std::optional<GaugeFigures> gauges;             ///< if distances or touches were measured
  /// For a model with a bias, PairedGain::z() of compensated against calibrated; empty in models
  /// from before it was kept.
  std::optional<double> bias_gain_z;
  /// Share of coordinates inside the 95 % interval of the stated sigma alone. Intervals that were
  /// widened until they held show nothing; this share shows whether the model is as good as the
  /// instrument. Empty in models from before it was kept.
  std::optional<double> coverage_95_stated;
};
[[nodiscard]] double nlpd_in_mm(double nlpd_in_m);

/// Mean over the coordinates of -log N(error; 0, stddev²), nat; empty where a stddev is 0.
[[nodiscard]] std::optional<double> negative_log_density(const Eigen::Matrix3Xd& error,
                                                         const Eigen::Matrix3Xd& stddev);
/// Share of coordinates inside their 95 % interval; a column for each row that was measured.
[[nodiscard]] double coverage_95(const Eigen::MatrixXd& error, const Eigen::MatrixXd& stddev);

}  // namespace trammel
