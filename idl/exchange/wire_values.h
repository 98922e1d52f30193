#pragma once

#include "correct_target.h"
#include "idl/limits.h"
#include "predict_error.h"
#include "server/exchange/answer.h"

/// Between what is exchanged with people (mm, deg) and the wire (mm, rad). The one place that knows
/// both, for server and clients.
namespace trammel::wire {

using namespace v2;

[[nodiscard]] PoseMm to_wire(const exchange::Pose& pose);
[[nodiscard]] exchange::Pose from_wire(const PoseMm& pose);

[[nodiscard]] Approach to_wire(const exchange::Approach& approach);
[[nodiscard]] CommandedJoints to_wire(const exchange::AskedJoints& asked);
[[nodiscard]] Target to_wire(const exchange::AskedTarget& asked);

[[nodiscard]] PredictedError to_wire(const exchange::Prediction& prediction);
[[nodiscard]] exchange::Prediction from_wire(const PredictedError& prediction);

/// The server cuts the message before, so that the largest reply stays below its sample limit.
[[nodiscard]] CorrectedTarget to_wire(const exchange::CorrectedTarget& correction,
                                      const exchange::Rails& rails);
[[nodiscard]] exchange::CorrectedTarget from_wire(const CorrectedTarget& correction,
                                                  const exchange::Rails& rails);
/// `ok`, `out_of_domain` ...
[[nodiscard]] const char* word_of(TargetStatus status);

}  // namespace trammel::wire
