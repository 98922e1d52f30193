#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/fleet/fleet_prior.h"
#include "server/health/health_check.h"
#include "server/store/store.h"
#include "server/tasks/accept/verdict.h"

/// The input and the result of one job, as values that can be sent to another process.
namespace trammel {

/// A batch as it was received.
struct BatchText {
  std::string id;  ///< empty: it came with the diagnosis that was asked for
  std::string csv;
  std::int64_t taken_in = 0;  ///< Unix time, s, when it was received
};

struct ComputeTask {
  std::shared_ptr<const Cell> cell;
  AskedJob asked = {};
  std::vector<std::string>
      batch_ids;  ///< to learn from or to diagnose, together; none: the one that was sent
  std::vector<std::string> earlier_ids =
      {};  ///< sessions of the same arm to learn from as well, oldest first
  std::vector<DriftSeen> earlier_checks = {};  ///< for a check: the drift by earlier checks
  bool hold_against_in_force =
      false;  ///< look at the batch first, and learn nothing from one that is strange
  std::optional<ModelText> in_force;
  std::optional<FleetPrior>
      fleet;  ///< set if the cell file says `prior: fleet` and there are twins
  std::uint64_t seed = 1;
  double validation_share = kUsualJudgingShare;
  double accept_ratio = GateOptions::kUsualAcceptRatio;
  std::int64_t now = 0;  ///< Unix time, s: when the model is trained
};

/// The product of a job.
struct Made {
  std::optional<CompensatedModel> model;
  std::string remarks;     ///< additions to the model's outcome: `; ` before each
  std::string quarantine;  ///< why nothing must be learned from the batch; empty: something was
  /// The message of a diagnosis that makes no model.
  std::string message = {};
  JobOutcome outcome = {};
  /// The output of serialize() for the model, if another process computed it; empty: this process
  /// did.
  std::string model_text = {};
};

/// The reports of a job on its way.
struct ComputeWatch {
  /// The stage that is being worked on and the share done of all in [0, 1]; false: give up.
  std::function<bool(const std::string& stage, double share)> progress;
  /// The findings of a diagnosis (JSON) and their page (HTML). An error ends the job.
  std::function<Status(const std::string& findings, const std::string& page)> found;
};

/// Why a process that computed has ended without an answer.
struct Breakdown {
  enum class Kind {
    kCrashed,     ///< by a signal or with an exit code
    kHung,        ///< it stood still
    kOverMemory,  ///< it asked for more than a job may have
    kOverTime,    ///< it took more processor time than a job may
    kStopped      ///< it was asked to stop: the job is cancelled, or the service stops
  };
  Kind kind = Kind::kCrashed;
  Error error;
};

struct ComputeCost {
  std::optional<std::int64_t> peak_memory;  ///< bytes
  std::optional<double> processor_time;     ///< s
};

/// Computes one job: it takes the batches one by one, makes the requested result, and judges it as
/// often as requested. For one thread.
class Computing {
 public:
  virtual ~Computing() = default;
  /// `judges`: the batch judges the job's model; judging batches come oldest first.
  [[nodiscard]] virtual Status take(const BatchText& batch, bool judges) = 0;
  [[nodiscard]] virtual Result<Made> make(const ComputeWatch& watch) = 0;
  /// After make() has made a model.
  [[nodiscard]] virtual Result<GateVerdict> judge(const Opponents& opponents) = 0;
  /// After an error: whether the process caused it, not the data.
  [[nodiscard]] virtual std::optional<Breakdown> breakdown() const { return std::nullopt; }
  /// Until now.
  [[nodiscard]] virtual ComputeCost cost() const { return {}; }
};

}  // namespace trammel
