#pragma once

#include "server/health/evidence/check_rows.h"

/// The part that a cause explains where positions alone, or orientations alone, may be noisier than
/// they should be.
namespace trammel::health {

enum class RowKind { kPositions, kOrientations };

/// By how much the columns `cause` (R x k) make twice the log likelihood of the residuals larger,
/// each side at the noise of that kind of rows that suits it best. The likelihood is that of what
/// columns which are `refitted` (R x f) do not touch.
[[nodiscard]] double gained_beside_noise(const CheckRows& rows, const Eigen::MatrixXd& covariance,
                                         const Eigen::MatrixXd& refitted,
                                         const Eigen::MatrixXd& cause, RowKind kind);

}  // namespace trammel::health
