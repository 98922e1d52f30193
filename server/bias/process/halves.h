#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

/// The rows of `table` (N x n) in parts of at most `most` neighbours each. A part that is too large
/// is halved across the column in which it spreads widest, again and again. The indices in a part
/// rise.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table,
                                                            Eigen::Index most);

/// Halves in parts of whole poses, at most `most` of them each, by the first row of each pose.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table,
                                                            const std::vector<PoseGroup>& poses,
                                                            Eigen::Index most);

/// N x n, as halved() takes them: in units of the length scales for a kernel with one length scale
/// for each joint; in rad for all others, whose idea of neighbours is not a single distance.
[[nodiscard]] Eigen::MatrixXd joints_as_seen_by(const Kernel& kernel,
                                                const Eigen::VectorXd& parameters,
                                                const Eigen::MatrixXd& q);

}  // namespace trammel
