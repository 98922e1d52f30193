#include "idl/valid.h"

#include <algorithm>

namespace trammel::wire {
namespace {

bool valid(const RequestHeader& header) { return valid_partition(header.reply_partition().to_string()); }
bool valid(const ReplyHeader& header) { return header.result() <= RESULT_WRONG_CONTRACT; }
bool valid(const Job& job) { return job.stage() <= JOB_FAILED; }

}  // namespace

bool valid_partition(std::string_view name) {
  return !name.empty() && name.size() <= MAX_NAME && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  });
}

bool valid(const PredictErrorRequest& request) { return valid(request.header()); }
bool valid(const CorrectTargetRequest& request) {
  const auto& targets = request.targets();
  return valid(request.header()) &&
         std::all_of(targets.begin(), targets.end(), [](const Target& t) { return t.kind() <= TARGET_JOINTS; });
}
bool valid(const SubmitMeasurementsRequest& request) { return valid(request.header()); }
bool valid(const TrainRequest& request) { return valid(request.header()); }
bool valid(const DiagnoseRequest& request) { return valid(request.header()); }
bool valid(const ManageModelsRequest& request) { return valid(request.header()) && request.action() <= MANAGE_JOBS; }

bool valid(const PredictErrorReply& reply) {
  return valid(reply.header()) && reply.predictions().size() <= MAX_TARGETS;
}
bool valid(const CorrectTargetReply& reply) {
  const auto& corrections = reply.corrections();
  return valid(reply.header()) && corrections.size() <= MAX_TARGETS &&
         std::all_of(corrections.begin(), corrections.end(), [](const CorrectedTarget& c) {
           return c.status() <= TARGET_REFUSED && c.joints_rad().size() <= MAX_JOINTS;
         });
}
bool valid(const SubmitMeasurementsReply& reply) { return valid(reply.header()); }
bool valid(const TrainReply& reply) { return valid(reply.header()); }
bool valid(const DiagnoseReply& reply) { return valid(reply.header()); }
bool valid(const ManageModelsReply& reply) {
  return valid(reply.header()) && valid(reply.job()) && reply.models().size() <= MAX_VERSIONS;
}

bool valid(const ModelStatus&) { return true; }
bool valid(const TrainingProgress& progress) { return valid(progress.job()); }
bool valid(const ServiceStatus& status) {
  return status.state() <= SERVICE_STOPPING && status.cells().size() <= MAX_CELLS;
}
bool valid(const ModelSnapshot&) { return true; }

}  // namespace trammel::wire
