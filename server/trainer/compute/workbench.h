#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/registry/model_registry.h"
#include "server/tasks/train/successor.h"
#include "server/tasks/train/train.h"
#include "server/trainer/compute/job_batches.h"
#include "server/trainer/compute/task.h"

namespace trammel {

struct Diagnosis;

/// The computing of a job in the process that calls it. Knows the pipeline and the gate, but
/// neither store nor registry.
class Workbench : public Computing {
 public:
  explicit Workbench(ComputeTask task, BatchReads reads = {});

  [[nodiscard]] Status take(const BatchText& batch, bool judges) override;
  [[nodiscard]] Result<Made> make(const ComputeWatch& watch) override;
  [[nodiscard]] Result<GateVerdict> judge(const Opponents& opponents) override;

 private:
  [[nodiscard]] Result<Made> trained(const AskedTraining& asked, const ComputeWatch& watch);
  [[nodiscard]] Result<Made> checked(const AskedCheck& asked, const ComputeWatch& watch);
  /// Puts a model of the own batch alone in place of one of all sessions: where the arm has
  /// `changed` and this one is better beyond chance on the batch's judges; and where the batch
  /// brings a tool that the model in force does not know and all sessions together are no better
  /// for the others.
  [[nodiscard]] Status choose_alone(Successor& together, bool changed, const ComputeWatch& watch);
  [[nodiscard]] Result<Made> diagnosed(const AskedDiagnosis& asked, const ComputeWatch& watch);
  /// With what the diagnosis of `batch` beside the sources `own` found.
  [[nodiscard]] Result<Made> extended(const CheckedBatch& batch,
                                      const std::vector<std::string>& own,
                                      const Diagnosis& diagnosis, const ComputeWatch& watch);
  /// extended() where no model is in force: extend(), as on files. Batches of models that were
  /// never in force do not judge it.
  [[nodiscard]] Result<Made> first_extended(const CheckedBatch& batch, const Diagnosis& diagnosis,
                                            const TrainOptions& options);
  /// The options that the job asks for: level and bias, and where it asks for nothing special what
  /// the model in force has besides.
  [[nodiscard]] TrainOptions train_options(const CheckedBatch& batch,
                                           const ComputeWatch& watch) const;
  [[nodiscard]] Made made(CompensatedModel model, std::string remarks,
                          std::vector<JudgingSession> sessions);
  /// Null where there is none.
  [[nodiscard]] Result<std::shared_ptr<const ServedModel>> in_force();
  [[nodiscard]] Result<ServedModel> loaded(const ModelText& text) const;

  const ComputeTask task_;
  JobBatches batches_;
  std::shared_ptr<const ServedModel> in_force_;  // once it was asked for
  std::optional<CompensatedModel> candidate_;    // once it is made
  std::shared_ptr<const ServedModel>
      without_;  // beside an extended one, where none is in force: the same without
  std::vector<JudgingSession> sessions_;  // that judge it, oldest first
};

}  // namespace trammel
