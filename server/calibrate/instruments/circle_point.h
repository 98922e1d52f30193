#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/calibrate/instruments/arc_list.h"

/// Circle-point analysis, source section 4.1: a reflector on the arm while one joint turns and all
/// others are held draws an arc; the arcs give the joints' axes, and the axes the link parameters
/// by the DH procedure.
namespace trammel {

/// One arc: the circle that fits its points best in space.
struct CircleFit {
  int joint = 0;
  std::string reflector;
  int points = 0;
  double span = 0;  ///< rad, from the first commanded angle to the last
  Vector3 centre_W = Vector3::Zero();
  double radius = 0;      ///< m
  double centre_u = 0;    ///< m, U(k=2) of the centre in its worst direction
  double plane_rms = 0;   ///< m, distance of the points from the circle's plane
  double circle_rms = 0;  ///< m, distance from the circle within the plane
};

/// The axis of one joint, from all its arcs together: circles on one axis, each with its own plane
/// and radius.
struct JointAxis {
  Vector3 direction_W =
      Vector3::Zero();  ///< unit vector in the kinematic sense, the joints before it at zero
  Vector3 point_W = Vector3::Zero();  ///< on the axis, with the joints before it at zero
  double direction_u = 0;             ///< rad, U(k=2) in its worst direction
  double sigma = 0;      ///< m, of one coordinate of a point: stated or from the residuals
  int freedom = 0;       ///< equations beyond unknowns
  double angle_rms = 0;  ///< rad, turned angle against commanded angle, offset removed
};

/// One number of the robot file, measured.
struct MeasuredParameter {
  std::string name;     ///< the name in the error source `geometry`: `a2`, `alpha1`, `q3`
  bool length = false;  ///< m, else rad
  double nominal = 0;
  double deviation = 0;   ///< measured - nominal
  double u = 0;           ///< U(k=2) of the deviation
  bool measured = false;  ///< false: arcs cannot show it, the nominal value stands
  std::string note;       ///< why not
};

struct CirclePointOptions {
  std::optional<double>
      sigma;  ///< m, of one coordinate; the residuals can only raise it. Empty: from the residuals
};

struct CirclePointResult {
  std::vector<CircleFit> circles;  ///< in the order of joints
  std::vector<JointAxis> axes;     ///< one per joint; without direction for a prismatic joint
  std::vector<MeasuredParameter> parameters;
  Eigen::MatrixXd
      covariance;  ///< of the deviations in the order of `parameters`, SI; zero where not measured
  std::vector<Note> notes;  ///< rows that arcs do not determine, and rows in a changed form
  Chain robot;              ///< the nominal robot with the measured rows
  Pose X_WB =
      Pose::Identity();  ///< base on axis 1: z0 is measured, height and azimuth are conventional
};

/// Fits the arcs and derives the links. Each arc is fitted in space by least squares on the
/// distances from its plane and its circle (normal, axis and radius together). The held postures of
/// other joints are undone with the axes already found. The links follow row by row: by the common
/// normal, eq. (3.3), or, in a Hayati row, by the point where the next axis meets the plane across
/// the present one, eq. (3.4). Uncertainties come from the fits by first derivatives; a sigma from
/// few residuals is widened by Student's t. Some rows are not measured: d1 and q1 (only axis 1
/// marks the base), the last link (nothing marks the flange), and the row of a prismatic joint,
/// whether along a SCARA's last axis, on a rail before the arm, or behind it. A row with parallel
/// axes becomes a Hayati row, whatever the robot file has. Refuses the same as sorted_by_joint()
/// and turning_joints(). Refuses points that lie on a line, turned angles that differ from the
/// commanded ones by more than 1 degree, and links more than 100 mm or 10 degrees from nominal.
[[nodiscard]] Result<CirclePointResult> analyse_circle_points(const Chain& robot,
                                                              const ArcList& arcs,
                                                              const CirclePointOptions& options);

}  // namespace trammel
