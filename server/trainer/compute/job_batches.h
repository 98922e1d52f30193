#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/tasks/accept/judging.h"
#include "server/trainer/compute/compute_options.h"
#include "server/trainer/compute/task.h"

namespace trammel {

/// The rows that a diagnosis leaves out. If its findings are to be applied, these are the rows that
/// judge them; otherwise the batch's own choice.
[[nodiscard]] HoldOut held_out_of_diagnosis(double validation_share, std::uint64_t seed,
                                            bool apply);

/// A received text as a batch of the cell. Refuses errors of the batch reader and of the cell. A
/// batch without an id gets one from its content.
[[nodiscard]] Result<CheckedBatch> received_batch(const BatchText& text, const Cell& cell,
                                                  const HoldOut& hold_out,
                                                  const BatchReads& reads = {});

/// The batches of one job, and those that judge its model. Each is parsed, checked and split once.
class JobBatches {
 public:
  /// `own`: the ids of the batches to work on; empty: the one without an id. `earlier`: further
  /// ones to learn from. The cell outlives it.
  JobBatches(const Cell& cell, HoldOut hold_out, BatchReads reads, std::vector<std::string> own,
             std::vector<std::string> earlier = {});

  /// `judges`: it is a judging batch; these come oldest first. A judging batch that no longer fits
  /// the changed cell does not count.
  void add(const BatchText& text, bool judges);

  /// The first of the batches to work on.
  [[nodiscard]] Result<CheckedBatch> first() const;
  /// first() without copies of rows that judge in older batches.
  [[nodiscard]] Result<CheckedBatch> first_without_older_judges();
  /// All to work on together, and the earlier ones that still fit the cell, without such copies:
  /// sessions of one arm.
  [[nodiscard]] Result<CheckedBatch> to_learn_from();
  /// The sessions whose rows may judge the job's model, oldest first.
  [[nodiscard]] const std::vector<JudgingSession>& judging_sessions();
  /// The judging sessions, with that of first() among them at `own`.
  struct SessionsOfDiagnosis {
    std::vector<JudgingSession> sessions;
    std::size_t own = 0;
  };
  [[nodiscard]] Result<SessionsOfDiagnosis> sessions_of_diagnosis();

 private:
  [[nodiscard]] Result<CheckedBatch> own(const std::string& id) const;
  [[nodiscard]] bool is_own(const std::string& id) const;

  const Cell& cell_;
  const HoldOut hold_out_;
  const BatchReads reads_;
  const std::vector<std::string> own_ids_, earlier_ids_;
  std::map<std::string, Result<CheckedBatch>> own_;  // by id, earlier ones among them
  std::vector<JudgingSession> sessions_;
  bool judge_once_ = false;  // sessions_ are as judge_once() leaves them
};

}  // namespace trammel
