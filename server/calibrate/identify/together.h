#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "server/measurement/measurement.h"
#include "server/robot/chain.h"

/// Tells bad rows from rows where the model lacks something.
namespace trammel {

/// Those of the rows `far` that lie among other large ones in joint space, rising. `farness`: the
/// misfit of each row of `batch`, in any unit.
///
/// A mistake spoils a row wherever it is, so the rows beside it in joint space are as good as any.
/// A cause that the model lacks changes with the joints, so beside a large misfit lie others. The
/// statistic is the mean rank of the misfits of the five nearest rows: by each joint, each pair of
/// joints, all of them, the reach of the flange, and reach and height, by which loads change. Its
/// chance comes from exchanges of the misfits among the rows, the choice among these included. A
/// row that is off by much more than its neighbours stays a bad row. Empty if the rows are too few
/// to tell. `far` is rising.
[[nodiscard]] std::vector<std::size_t> together_in_joints(const Chain& robot,
                                                          const MeasurementBatch& batch,
                                                          const Eigen::VectorXd& farness,
                                                          const std::vector<std::size_t>& far);

}  // namespace trammel
