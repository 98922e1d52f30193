#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/repairs/valid.h"
#include "server/registry/model_registry.h"
#include "server/trainer/trainer.h"

/// Converts between the wire (mm, rad; prismatic joints mm) and the inside (m, rad). Predictions
/// and corrections: compensate/exchanged.h and idl/exchange.
namespace trammel {

/// Refuses non-finite numbers and a quaternion whose length differs from 1 by more than 1e-3.
/// `where` names the pose in the error.
[[nodiscard]] Result<Pose> from_wire(const wire::PoseMm& pose, const std::string& where);

/// Refuses non-finite numbers and a number of joints that is not the robot's. `where` names the
/// vector in the error.
[[nodiscard]] Result<JointVector> from_wire(const wire::Joints& joints, const Chain& chain,
                                            const std::string& where);

/// Refuses directions that are not one of -1, 0, +1 for each joint, and infinite numbers. Unknown
/// values stay unknown.
[[nodiscard]] Status read_approach(const wire::Approach& approach, const Chain& chain,
                                   const std::string& where, PoseContext& context);

/// The first MAX_NOTES.
[[nodiscard]] std::vector<wire::Note> to_wire(const std::vector<Note>& notes);
/// Its error budget in words, the first lines; empty: it has none.
[[nodiscard]] std::vector<std::string> budget_to_wire(const ServedModel& served);
[[nodiscard]] wire::ModelInfo to_wire(const ServedModel& served, bool in_force,
                                      std::int64_t now_unix_s);
[[nodiscard]] wire::ModelInfo to_wire(const StoredModel& stored, std::int64_t now_unix_s);
/// The published form, without batches and times, which to_wire(DatedJob) has.
[[nodiscard]] wire::Job to_wire(const JobProgress& progress);
[[nodiscard]] wire::Job to_wire(const Trainer::DatedJob& job);
[[nodiscard]] wire::BatchInfo to_wire(const StoredBatch& batch);
[[nodiscard]] wire::ResultCode to_wire(ErrorCode code);

/// Which DDS participant sent the request, and its trace.
[[nodiscard]] std::string requester(const wire::RequestHeader& header);
/// The request in one line: the verb, the cell, and a hash of all the rest.
[[nodiscard]] std::string in_few_words(const std::string& verb, const std::string& cell,
                                       const std::vector<std::string>& rest);
/// Empty: whatever. Refuses a version that there cannot be.
[[nodiscard]] Result<std::optional<int>> expected_version(const wire::Change& change);

/// The error in the header of a reply: code, sentence and data.
void put_error(const Error& error, wire::ReplyHeader& header);
void put_error(const wire::Fault& fault, wire::ReplyHeader& header);
/// The reply about something that this server knows, and does not do.
template <typename Reply>
[[nodiscard]] Reply unsupported(const std::string& field) {
  Reply reply;
  put_error(
      wire::Fault{wire::RESULT_UNSUPPORTED, "this server does not do that", {}, field, {}, {}},
      reply.header());
  return reply;
}

/// Cut to so many bytes, between two characters.
[[nodiscard]] std::string cut(const std::string& text, std::size_t most_bytes);

/// `<writer GUID in hex>:<sequence number>`.
[[nodiscard]] std::string request_id_text(const wire::SampleIdentity& id);

[[nodiscard]] std::int64_t unix_now_s();

/// An error reply to the same request, for a `reply` that is too large for the wire or has values
/// that the wire cannot carry.
template <typename Reply>
[[nodiscard]] std::shared_ptr<void> instead_of(const void* reply) {
  const wire::ReplyHeader& meant = static_cast<const Reply*>(reply)->header();
  auto error = std::make_shared<Reply>();
  put_error(failure(ErrorCode::kInternal, "the answer does not fit on the wire")
                .next("ask for less of it, or look at the texts of the model in force")
                .value(),
            error->header());
  error->header().related_request_id(meant.related_request_id());
  error->header().server(meant.server());
  error->header().contract_version(meant.contract_version());
  error->header().trace_id(meant.trace_id());
  return error;
}

}  // namespace trammel
