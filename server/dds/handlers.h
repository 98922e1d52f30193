#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "idl/repairs/valid.h"
#include "server/base/mutex.h"
#include "server/dds/portioned_answer.h"
#include "server/metrics/work_counts.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

class ClientNames;

/// The subject of a request, looked up once. The whole answer comes from this one model.
struct Subject {
  std::shared_ptr<const ServedModel> served;
  bool in_force = false;
  std::string tool, payload;  ///< resolved
};

/// Looks up the cell, tool, payload and model that a request's context names. Keeps the stored
/// versions that were asked for last in memory. Thread-safe.
class SubjectFinder {
 public:
  SubjectFinder(const Trainer& trainer, const ModelRegistry& registry)
      : trainer_(trainer), registry_(registry) {}

  /// The cell's description. Refuses an unknown cell, tool or payload. Refuses a controller with
  /// compensation, since models are trained on data from one without.
  [[nodiscard]] Result<std::shared_ptr<const Cell>> cell(const wire::Context& context) const;
  /// As cell(), and also refuses a cell without a model in force, an unknown version, and a model
  /// id that is not in force.
  [[nodiscard]] Result<Subject> find(const wire::Context& context);

 private:
  [[nodiscard]] Result<std::shared_ptr<const ServedModel>> version(const std::string& cell,
                                                                   int version);

  const Trainer& trainer_;
  const ModelRegistry& registry_;
  Mutex mutex_;
  std::deque<std::shared_ptr<const ServedModel>> loaded_
      TRAMMEL_GUARDED_BY(mutex_);  // newest first
};

/// Answers requests: a decoded request in, a reply or an error out. No DDS. The caller fills in the
/// headers. Thread-safe.
class Handlers {
 public:
  Handlers(Trainer& trainer, Store& store, const ModelRegistry& registry)
      : trainer_(trainer), store_(store), registry_(registry), subjects_(trainer, registry) {}

  /// The names of clients; null: nobody has one. They outlive the requests. Set before there are
  /// any.
  void set_names(const ClientNames* names) { names_ = names; }
  /// The subject of the certificate of a DDS participant; empty: it has shown none.
  [[nodiscard]] std::string name_of(const std::string& participant) const;

  /// Counts of the requests to the cells since the start.
  [[nodiscard]] const WorkCounts& work() const { return work_; }

  using Predictions = std::unique_ptr<PortionedAnswer<wire::PredictErrorReply>>;
  using Corrections = std::unique_ptr<PortionedAnswer<wire::CorrectTargetReply>>;
  /// Checks the whole request and takes the model.
  [[nodiscard]] Result<Predictions> begin(const wire::PredictErrorRequest& request);
  [[nodiscard]] Result<Corrections> begin(const wire::CorrectTargetRequest& request);
  /// All of begin(), computed here and now.
  [[nodiscard]] Result<wire::PredictErrorReply> answer(const wire::PredictErrorRequest& request);
  [[nodiscard]] Result<wire::CorrectTargetReply> answer(const wire::CorrectTargetRequest& request);
  /// Accepted means stored: see Trainer::submit.
  [[nodiscard]] Result<wire::SubmitMeasurementsReply> answer(
      const wire::SubmitMeasurementsRequest& request);
  [[nodiscard]] Result<wire::TrainReply> answer(const wire::TrainRequest& request);
  /// Queues a diagnosis: see Trainer::diagnose.
  [[nodiscard]] Result<wire::DiagnoseReply> answer(const wire::DiagnoseRequest& request);
  [[nodiscard]] Result<wire::CheckHealthReply> answer(const wire::CheckHealthRequest& request);
  [[nodiscard]] Result<wire::ReadModelsReply> answer(const wire::ReadModelsRequest& request);
  [[nodiscard]] Result<wire::ManageModelsReply> answer(const wire::ManageModelsRequest& request);
  [[nodiscard]] Result<wire::ReleaseBatchesReply> answer(
      const wire::ReleaseBatchesRequest& request);

 private:
  /// The sender of the request, for the audit trail: the name, the participant, the trace.
  [[nodiscard]] std::string who(const wire::RequestHeader& header) const;
  /// The job.
  [[nodiscard]] Result<std::int64_t> trained(const wire::TrainRequest& request);
  /// The version activated, gone back to or imported; 0: none.
  [[nodiscard]] Result<int> changed(const std::string& cell,
                                    const wire::ManageModelsRequest& request);
  [[nodiscard]] Status cancel(const std::string& cell, std::int64_t job, const ChangeId& by);
  /// The job, or 0.
  [[nodiscard]] Result<std::int64_t> released(const std::string& cell,
                                              const wire::ReleaseBatchesRequest& request);
  [[nodiscard]] Result<wire::ReadModelsReply> read(const std::string& cell,
                                                   const wire::ReadModelsRequest& request) const;
  [[nodiscard]] Result<wire::ReadModelsReply> job_of(std::int64_t job) const;
  [[nodiscard]] Result<wire::ReadModelsReply> models_of(const std::string& cell) const;
  /// The text of the model file of `version`; version 0 is the one in force.
  [[nodiscard]] Result<wire::ReadModelsReply> exported(const std::string& cell, int version) const;
  /// The recent requests to the cell, answered by the model in force and by `version`; 0: by the
  /// first alone.
  [[nodiscard]] Result<wire::ReadModelsReply> replayed(const std::string& cell, int version) const;
  [[nodiscard]] Result<wire::ReadModelsReply> batch_of(const std::string& cell,
                                                       const std::string& id) const;
  [[nodiscard]] Result<wire::ReadModelsReply> jobs_of(const std::string& cell) const;
  [[nodiscard]] Result<wire::ReadModelsReply> audit_of(const std::string& cell, std::int64_t since,
                                                       std::size_t most) const;
  [[nodiscard]] Result<wire::ReadModelsReply> findings_of(const std::string& cell, std::int64_t job,
                                                          bool page) const;
  [[nodiscard]] Result<wire::ReadModelsReply> fleet() const;
  /// The newest `most` checks of one cell after `since`. An empty `cell` means each of all cells.
  [[nodiscard]] Result<wire::ReadModelsReply> health_of(const std::string& cell, std::int64_t since,
                                                        std::size_t most) const;

  Trainer& trainer_;
  Store& store_;
  const ModelRegistry& registry_;
  SubjectFinder subjects_;
  const ClientNames* names_ = nullptr;
  WorkCounts work_;  // requests refer to it, and are destroyed before it
};

/// Computes all of an answer in one thread.
template <typename Reply>
[[nodiscard]] Result<Reply> computed(Result<std::unique_ptr<PortionedAnswer<Reply>>> begun) {
  if (!begun) return tl::make_unexpected(begun.error());
  (*begun)->compute(0, (*begun)->items());
  return (*begun)->take();
}

/// True if the request changes something. A repeat of such a request must not be carried out again.
[[nodiscard]] bool happens_once(const wire::PredictErrorRequest& request);
[[nodiscard]] bool happens_once(const wire::CorrectTargetRequest& request);
[[nodiscard]] bool happens_once(const wire::SubmitMeasurementsRequest& request);
[[nodiscard]] bool happens_once(const wire::TrainRequest& request);
[[nodiscard]] bool happens_once(const wire::DiagnoseRequest& request);
[[nodiscard]] bool happens_once(const wire::CheckHealthRequest& request);
[[nodiscard]] bool happens_once(const wire::ReadModelsRequest& request);
[[nodiscard]] bool happens_once(const wire::ManageModelsRequest& request);
[[nodiscard]] bool happens_once(const wire::ReleaseBatchesRequest& request);

}  // namespace trammel
