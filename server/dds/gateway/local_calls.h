#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/dds/gateway/local_endpoint.h"

namespace trammel {

/// The lanes of a service, as the operations need them.
struct AllLanes {
  Lane& predictions;
  Lane& corrections;
  Lane& reads;
  Lane& changes;
};

/// ServiceCalls for the lanes of a running service.
class LocalCalls final : public ServiceCalls {
 public:
  /// All outlive it; its callers have left before the lanes are destroyed.
  LocalCalls(ServiceCore& service, ClientNames& names, const AllLanes& lanes);

  /// Everybody who waits is told that the service stops; nobody waits afterwards.
  void close() { replies_.close(); }
  [[nodiscard]] std::array<const RequestEndpointBase*, 8> endpoints() const;

  Answers<exchange::Prediction> predict(const CallFrom& from, const CallAbout& about,
                                        const std::vector<exchange::AskedJoints>& poses,
                                        CallOutcome& outcome) override;
  Answers<exchange::CorrectedTarget> correct(const CallFrom& from, const CallAbout& about,
                                             const std::vector<exchange::AskedTarget>& targets,
                                             CallOutcome& outcome) override;
  Result<std::int64_t> submit(const CallFrom& from, const CallAbout& about, const SentBatch& batch,
                              CallOutcome& outcome) override;
  Result<std::int64_t> train(const CallFrom& from, const CallAbout& about, const Training& training,
                             CallOutcome& outcome) override;
  Result<std::int64_t> diagnose(const CallFrom& from, const CallAbout& about,
                                const SentBatch& batch, CallOutcome& outcome) override;
  Result<std::int64_t> check(const CallFrom& from, const CallAbout& about, const SentBatch& batch,
                             std::optional<double> tolerance_mm, CallOutcome& outcome) override;
  Result<exchange::ModelInfo> activate(const CallFrom& from, const CallAbout& about,
                                       const Activation& change, CallOutcome& outcome) override;
  Result<std::vector<exchange::ModelInfo>> models(const CallFrom& from, const CallAbout& about,
                                                  CallOutcome& outcome) override;
  Result<std::vector<exchange::DatedJob>> jobs(const CallFrom& from, const CallAbout& about,
                                               std::int64_t job, CallOutcome& outcome) override;
  Result<std::string> findings(const CallFrom& from, const CallAbout& about, std::int64_t job,
                               CallOutcome& outcome) override;
  Result<std::string> fleet(const CallFrom& from, CallOutcome& outcome) override;

 private:
  const Trainer& trainer_;
  const std::string server_id_;
  LocalClients clients_;
  WaitingReplies replies_;
  LocalCore core_;
  LocalEndpoint<wire::PredictError> predict_;
  LocalEndpoint<wire::CorrectTarget> correct_;
  LocalEndpoint<wire::SubmitMeasurements> submit_;
  LocalEndpoint<wire::Train> train_;
  LocalEndpoint<wire::Diagnose> diagnose_;
  LocalEndpoint<wire::CheckHealth> check_;
  LocalEndpoint<wire::ReadModels> read_;
  LocalEndpoint<wire::ManageModels> manage_;
};

}  // namespace trammel
