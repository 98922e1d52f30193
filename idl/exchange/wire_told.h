#pragma once

#include <string>

#include "common.h"
#include "read_models.h"
#include "server/base/result.h"
#include "server/exchange/answer.h"
#include "server/exchange/history.h"

/// What a service tells of models, jobs, batches and errors, from the wire into the values of
/// server/exchange. For clients and for gateways of other protocols.
namespace trammel::wire {

using namespace v2;

[[nodiscard]] exchange::ModelInfo from_wire(const ModelInfo& info);
[[nodiscard]] exchange::JobStatus status_of(const Job& job);
/// `server`: the one that listed it.
[[nodiscard]] exchange::DatedJob from_wire(const Job& job, const std::string& server);
[[nodiscard]] exchange::BatchOfService from_wire(const BatchInfo& batch);
/// The error in a reply that is not RESULT_OK.
[[nodiscard]] Error error_of(const ReplyHeader& header);

}  // namespace trammel::wire
