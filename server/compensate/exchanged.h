#pragma once

#include "server/compensate/compensated_model.h"
#include "server/exchange/si.h"

/// What a model answers, as it is exchanged with people and other programs.
namespace trammel {

[[nodiscard]] exchange::Prediction exchanged(const ErrorPrediction& prediction);
[[nodiscard]] exchange::CorrectedTarget exchanged(const Correction& correction,
                                                  const exchange::Rails& rails);

/// What is asked, as a model takes it. The caller has checked the numbers.
[[nodiscard]] Target target_of(const exchange::AskedTarget& asked, const Chain& robot);
/// The same the other way.
[[nodiscard]] exchange::AskedTarget asked_of(const Target& target, const exchange::Rails& rails);
/// Joints that are served, with tool and payload of the cell.
[[nodiscard]] PoseContext context_of(const exchange::AskedJoints& asked, const Chain& robot,
                                     const std::string& tool, const std::string& payload);

}  // namespace trammel
