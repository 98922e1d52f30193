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
  /// Replaces a model of all sessions by one of the own batch alone in two cases: the arm has
  /// `changed` and that model is better beyond chance on the batch's judging rows; or the batch
  /// brings a tool that the model in force lacks, and the model of all sessions is no better for
  /// the other tools.
  [[nodiscard]] Status choose_alone(Successor& together, bool changed, const ComputeWatch& watch);
  [[nodiscard]] Result<Made> diagnosed(const AskedDiagnosis& asked, const ComputeWatch& watch);
  /// An extended model with the findings of the diagnosis of `batch`, beside the sources `own`.
  [[nodiscard]] Result<Made> extended(const CheckedBatch& batch,
                                      const std::vector<std::string>& own,
                                      const Diagnosis& diagnosis, const ComputeWatch& watch);
  /// extended() for a cell without a model in force: extend(), as with files. Batches of models
  /// that were never in force do not judge it.
  [[nodiscard]] Result<Made> first_extended(const CheckedBatch& batch, const Diagnosis& diagnosis,
                                            const TrainOptions& options);
  /// The options of the job: its level and bias. If it states none, the additions of the model in
  /// force are used.
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
  std::shared_ptr<const ServedModel> without_;   // beside an extended one without a model in force:
                                                 // the same model without the findings
  std::vector<JudgingSession> sessions_;         // judging sessions, oldest first
};

}  // namespace trammel
