#pragma once

#include <memory>

#include "idl/transport/ros2.h"
#include "server/registry/model_registry.h"
#include "server/trainer/trainer.h"

/// Between the messages of ROS 2 nodes (m, rad; rails m) and the wire (mm, rad; rails mm).
namespace trammel::ros2 {

using wire::ros2::CorrectedTargets_;
using wire::ros2::CorrectTargets_;
using wire::ros2::PredictedErrors_;
using wire::ros2::PredictErrors_;

/// The equivalent request; its fault says which lists do not fit each other. `cells` gives the
/// types of the joints.
[[nodiscard]] std::unique_ptr<wire::Received<wire::PredictErrorRequest>> asked(
    const wire::ReceivedMessage<PredictErrors_>& message, const ServedCells& cells);
[[nodiscard]] std::unique_ptr<wire::Received<wire::CorrectTargetRequest>> asked(
    const wire::ReceivedMessage<CorrectTargets_>& message, const ServedCells& cells);

/// The equivalent message. Its id is the trace of the request.
[[nodiscard]] PredictedErrors_ answered(const wire::PredictErrorReply& reply,
                                        const ServedCells& cells);
[[nodiscard]] CorrectedTargets_ answered(const wire::CorrectTargetReply& reply,
                                         const ServedCells& cells);

}  // namespace trammel::ros2
