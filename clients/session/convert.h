#pragma once

#include <string>

#include "clients/session/session_types.h"
#include "idl/valid.h"
#include "server/base/result.h"

/// Between the session's types and the wire's.
namespace trammel::client {

[[nodiscard]] wire::Context to_wire(const CallContext& context);
[[nodiscard]] wire::Target to_wire(const TargetMm& target);

[[nodiscard]] ModelInfo from_wire(const wire::ModelInfo& info);
[[nodiscard]] PredictedError from_wire(const wire::PredictedError& prediction);
[[nodiscard]] CorrectedTarget from_wire(const wire::CorrectedTarget& correction);
[[nodiscard]] JobStatus from_wire(const wire::Job& job);
[[nodiscard]] ServerStatus from_wire(const wire::ServiceStatus& status);
/// The list that MANAGE_QUARANTINE answers. Refuses what is none.
[[nodiscard]] Result<std::vector<QuarantinedBatch>> quarantine_from(const std::string& json);
/// What MANAGE_RELEASE_AND_TRAIN is told.
[[nodiscard]] std::string release_text(const std::vector<std::string>& batch_ids, const std::string& level,
                                       const std::string& bias);
/// The list that MANAGE_JOBS answers. Refuses what is none.
[[nodiscard]] Result<std::vector<DatedJob>> jobs_from(const std::string& json, const std::string& server);
/// Of a reply that is not RESULT_OK.
[[nodiscard]] Error error_of(const wire::ReplyHeader& header);

}  // namespace trammel::client
