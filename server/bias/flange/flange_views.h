#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/linear_block.h"

/// The arm's error at the flange, seen through levers (README.md).
namespace trammel {

/// Each row maps a twist [position; rotation] to one measured number.
using TwistRows = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::ColMajor, 6, 6>;
/// The part of the twist that one coordinate of each row sees.
using TwistRow = Eigen::Matrix<double, 3, 6>;

/// All rows of one joint vector, reduced to the fewest numbers with the same information about the
/// twist: rows / sqrt(noise shape) = basis (view twist + noise of unit shape) + a part that no
/// twist explains.
struct FlangeView {
  std::vector<Eigen::Index> rows;  ///< of the observations, rising
  TwistRows view;                  ///< r x 6, r <= 6
  Eigen::MatrixXd basis;           ///< 3 rows x r, orthonormal columns
  Eigen::Index first = 0;          ///< place of its r numbers among those of all views
};

struct FlangeViews {
  Eigen::MatrixXd q;              ///< M x n: each joint vector once, rad
  std::vector<FlangeView> views;  ///< M
  Eigen::Index size = 0;          ///< numbers of all views
  Eigen::VectorXd noise_shape;    ///< N, of the observations
  std::vector<TwistRow> seen;     ///< N
  Vector3 reference_F =
      Vector3::Zero();  ///< the reference point of the twist's position part: the mean lever
};

/// The view of the twist at `reference_F` by an observation: [I  -[R_BF (lever - reference)]x].
[[nodiscard]] TwistRow seen_through(const BiasFeatures& features, const Vector3& reference_F);
/// True if not all levers are the same, to a millimetre.
[[nodiscard]] bool has_several_levers(const std::vector<BiasFeatures>& features);

/// Rows with the same joints become one view.
[[nodiscard]] FlangeViews views_of(const Eigen::MatrixXd& q, const Eigen::VectorXd& noise_shape,
                                   const std::vector<BiasFeatures>& features);
/// These views alone.
[[nodiscard]] FlangeViews some_of(const FlangeViews& all, const std::vector<Eigen::Index>& views);

/// `y` (N x 3) expressed in the views: their numbers, and the square of the part that no twist
/// explains.
struct SeenNumbers {
  Eigen::VectorXd of_twist;  ///< size
  double beside = 0;
  Eigen::Index beside_freedom = 0;  ///< coordinates beyond the numbers
  double log_shape = 0;             ///< of the noise shapes of all coordinates, summed
};
[[nodiscard]] SeenNumbers numbers_of(const FlangeViews& views, const Eigen::MatrixXd& y);
/// The coordinates of the rows of a view, each over the root of its noise shape.
[[nodiscard]] Eigen::VectorXd even_rows(const FlangeViews& views, const FlangeView& view,
                                        const Eigen::MatrixXd& y);

}  // namespace trammel
