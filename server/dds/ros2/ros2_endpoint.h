#pragma once

#include <memory>

#include "server/dds/request_endpoint.h"

namespace trammel {

/// Answers ROS 2 nodes on an operation of ros2.h, in the same lanes and with the same limits as
/// other clients. `writing` supervises the written samples; all arguments outlive the endpoint.
/// `Ros`: wire::Ros2PredictErrors or wire::Ros2CorrectTargets.
template <typename Ros>
[[nodiscard]] Result<std::unique_ptr<RequestEndpointBase>> open_ros2_endpoint(
    ServiceCore& core, Lane& lane, WorkUnderWay& writing);

}  // namespace trammel
