#pragma once

#include <string>

#include "clients/session/session_types.h"
#include "idl/repairs/valid.h"
#include "server/base/result.h"

/// Converts between the types of the session and those of the wire.
namespace trammel::client {

[[nodiscard]] wire::Context to_wire(const CallContext& context);
[[nodiscard]] wire::CommandedJoints to_wire(const CommandedJoints& pose);
[[nodiscard]] wire::Target to_wire(const TargetMm& target);

[[nodiscard]] ModelInfo from_wire(const wire::ModelInfo& info);
[[nodiscard]] PredictedError from_wire(const wire::PredictedError& prediction);
[[nodiscard]] CorrectedTarget from_wire(const wire::CorrectedTarget& correction);
[[nodiscard]] JobStatus status_of(const wire::Job& job);
[[nodiscard]] ServerStatus from_wire(const wire::ServiceStatus& status);
[[nodiscard]] DatedJob from_wire(const wire::Job& job, const std::string& server);
[[nodiscard]] BatchOfService from_wire(const wire::BatchInfo& batch);
/// The error in a reply that is not RESULT_OK.
[[nodiscard]] Error error_of(const wire::ReplyHeader& header);

}  // namespace trammel::client
