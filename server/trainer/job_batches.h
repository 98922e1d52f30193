#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/trainer/acceptance/judging.h"
#include "server/trainer/trainer_options.h"

namespace trammel {

/// Refused while the batch is in quarantine: nothing is learned from it.
[[nodiscard]] Status check_released(const StoredBatch& batch);

/// The rows that are held out where the service learns from a batch.
[[nodiscard]] HoldOut held_out_to_judge(const TrainerOptions& options);
/// The rows that a diagnosis does not look at: those held out to judge what it finds, where that is to be applied, else
/// what the batch says itself.
[[nodiscard]] HoldOut held_out_of_diagnosis(const TrainerOptions& options, bool apply);

/// A text that was received at `taken_in` (Unix time, s) as a batch of the cell. Refuses what the batch reader and the
/// cell refuse.
[[nodiscard]] Result<CheckedBatch> received_batch(const std::string& csv, const std::string& id, std::int64_t taken_in,
                                                  const Cell& cell, const HoldOut& hold_out);
/// The same of a text that came with a diagnosis: its id is made from its content.
[[nodiscard]] Result<CheckedBatch> sent_batch(const std::string& csv, std::int64_t taken_in, const Cell& cell,
                                              const HoldOut& hold_out);

/// The batches that one job works on, and those that judge what it makes. Each of them is parsed, checked and split
/// once.
class JobBatches {
 public:
  /// `asked`: of a diagnosis. The others outlive it.
  JobBatches(const Store& store, const StoredJob& job, const Cell& cell, const TrainerOptions& options,
             StoredDiagnosis asked = {});

  /// The first batch of the job, or the one that came with it.
  [[nodiscard]] Result<CheckedBatch> first();
  /// All batches of the job together, without copies of rows that judge in older batches. Refuses batches in quarantine
  /// that the job may not release.
  [[nodiscard]] Result<CheckedBatch> to_learn_from();
  /// first(), without such copies where what is found is to be applied.
  [[nodiscard]] Result<CheckedBatch> to_diagnose();
  /// The stored batches whose rows may judge what the job makes: not in quarantine, not waiting, nothing that failed.
  /// Oldest first.
  [[nodiscard]] Result<std::vector<JudgingSession>> judging_sessions();
  /// The same with that of first() among them, at `own`.
  struct SessionsOfDiagnosis {
    std::vector<JudgingSession> sessions;
    std::size_t own = 0;
  };
  [[nodiscard]] Result<SessionsOfDiagnosis> sessions_of_diagnosis();

 private:
  [[nodiscard]] Result<CheckedBatch> own(const std::string& id);
  [[nodiscard]] bool is_own(const std::string& id) const;
  /// Empty where it does not fit the cell, which has changed since.
  [[nodiscard]] Result<std::optional<JudgingSession>> session_of(const std::string& id);

  const Store& store_;
  const StoredJob& job_;
  const Cell& cell_;
  const HoldOut hold_out_;
  const StoredDiagnosis asked_;
  std::map<std::string, CheckedBatch> own_;              // by id, as far as they were asked for
  std::optional<std::vector<JudgingSession>> sessions_;  // once they were asked for
};

}  // namespace trammel
