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

/// The rows that a diagnosis does not look at: those held out to judge what it finds, where that is
/// to be applied, else what the batch says itself.
[[nodiscard]] HoldOut held_out_of_diagnosis(double validation_share, std::uint64_t seed,
                                            bool apply);

/// A text that was received as a batch of the cell. Refuses what the batch reader and the cell
/// refuse. One without an id gets it from its content.
[[nodiscard]] Result<CheckedBatch> received_batch(const BatchText& text, const Cell& cell,
                                                  const HoldOut& hold_out,
                                                  const BatchReads& reads = {});

/// The batches that one job works on, and those that judge what it makes. Each of them is parsed,
/// checked and split once.
class JobBatches {
 public:
  /// `own`: the ids of those to work on; none: the one without an id. `earlier`: those to learn
  /// from as well. The cell outlives it.
  JobBatches(const Cell& cell, HoldOut hold_out, BatchReads reads, std::vector<std::string> own,
             std::vector<std::string> earlier = {});

  /// `judges`: it is one of those that judge, which come oldest first. One of these that does not
  /// fit the cell, which has changed since, does not count.
  void add(const BatchText& text, bool judges);

  /// The first of those to work on.
  [[nodiscard]] Result<CheckedBatch> first() const;
  /// first() without copies of rows that judge in older batches.
  [[nodiscard]] Result<CheckedBatch> first_without_older_judges();
  /// All to work on together, and the earlier ones that still fit the cell, without such copies:
  /// sessions of one arm.
  [[nodiscard]] Result<CheckedBatch> to_learn_from();
  /// Those whose rows may judge what the job makes, oldest first.
  [[nodiscard]] const std::vector<JudgingSession>& judging_sessions();
  /// Those sessions with that of first() among them, at `own`.
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
