#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

/// Splits the rows of `table` (N x n) into parts of at most `most` neighbours. A part that is too
/// large is halved along its widest column, repeatedly. The indices in a part rise.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table,
                                                            Eigen::Index most);

/// Splits into parts of whole poses, at most `most` of them each, by the first row of each pose.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table,
                                                            const std::vector<PoseGroup>& poses,
                                                            Eigen::Index most);

/// N x n, the input of halved(): in units of the length scales for a kernel with one length scale
/// per joint, and in rad for other kernels, which do not measure nearness by a single distance.
[[nodiscard]] Eigen::MatrixXd joints_as_seen_by(const Kernel& kernel,
                                                const Eigen::VectorXd& parameters,
                                                const Eigen::MatrixXd& q);

}  // namespace trammel
