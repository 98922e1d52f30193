#pragma once

#include "server/health/evidence/check_rows.h"

/// The part that a cause explains when positions alone, or orientations alone, may be noisier than
/// expected.
namespace trammel::health {

enum class RowKind { kPositions, kOrientations };

/// The gain of the columns `cause` (R x k) in twice the log likelihood of the residuals. Both sides
/// use the noise of that kind of rows that suits them best. The likelihood is that of the part
/// outside the `refitted` columns (R x f).
[[nodiscard]] double gained_beside_noise(const CheckRows& rows, const Eigen::MatrixXd& covariance,
                                         const Eigen::MatrixXd& refitted,
                                         const Eigen::MatrixXd& cause, RowKind kind);

}  // namespace trammel::health
