#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"
#include "server/exchange/history.h"

namespace trammel {

/// The sender of a call, and how long it waits.
struct CallFrom {
  std::string client;                     ///< clients are served in turn; stands in the audit trail
  std::chrono::milliseconds deadline{0};  ///< 0: the server's own limit
  std::string trace = {};                 ///< of the client's choice, at most 64 bytes; for the log
};

/// The subject of a call, which must match the training of the model.
struct CallAbout {
  std::string cell;
  std::string tool = {}, payload = {};  ///< empty: the cell's only one
  bool controller_compensates = false;
  std::string model = {};  ///< empty: the one in force; `@3`; an id or hash that must be in force
};

/// A batch that a client sends along: a file of measurements, as it is on disk.
struct SentBatch {
  std::string change_id;  ///< unique for ever: the change happens once; empty: no such promise
  std::string batch_id;
  std::string csv;
};

/// A training from batches that are stored.
struct Training {
  std::string change_id;               ///< as SentBatch::change_id
  std::vector<std::string> batch_ids;  ///< none: the newest batch
  std::string level, bias;             ///< empty: as the cell file says
};

/// A version to put in force.
struct Activation {
  std::string change_id;                     ///< as SentBatch::change_id
  std::optional<int> version = {};           ///< empty: back to the one in force before
  bool force = false;                        ///< also one that is worse on the poses held out
  std::optional<int> expected_version = {};  ///< that must be in force; otherwise kConflict
  std::string reason = {};                   ///< for the audit trail
};

/// What the reply says beside its answer.
struct CallOutcome {
  std::string result = "ok";  ///< the result code in words: `busy`, `deadline_missed`, `refused`
  std::chrono::milliseconds retry_after{0};  ///< of `busy` and `deadline_missed`
};

/// Asks the service from inside its process, for a gateway of another protocol. A call goes through
/// the same checks, lanes, limits and handlers as a request on DDS, and stands in the same counts,
/// records and audit trail. The caller waits for the answer. Thread-safe.
class ServiceCalls {
 public:
  virtual ~ServiceCalls() = default;

  template <typename T>
  using Answers = Result<exchange::Answer<T>>;
  [[nodiscard]] virtual Answers<exchange::Prediction> predict(
      const CallFrom& from, const CallAbout& about, const std::vector<exchange::AskedJoints>& poses,
      CallOutcome& outcome) = 0;
  [[nodiscard]] virtual Answers<exchange::CorrectedTarget> correct(
      const CallFrom& from, const CallAbout& about,
      const std::vector<exchange::AskedTarget>& targets, CallOutcome& outcome) = 0;

  /// The number of the job. Accepted means stored.
  [[nodiscard]] virtual Result<std::int64_t> submit(const CallFrom& from, const CallAbout& about,
                                                    const SentBatch& batch,
                                                    CallOutcome& outcome) = 0;
  [[nodiscard]] virtual Result<std::int64_t> train(const CallFrom& from, const CallAbout& about,
                                                   const Training& training,
                                                   CallOutcome& outcome) = 0;
  [[nodiscard]] virtual Result<std::int64_t> diagnose(const CallFrom& from, const CallAbout& about,
                                                      const SentBatch& batch,
                                                      CallOutcome& outcome) = 0;
  /// `tolerance_mm` empty: as the cell file says.
  [[nodiscard]] virtual Result<std::int64_t> check(const CallFrom& from, const CallAbout& about,
                                                   const SentBatch& batch,
                                                   std::optional<double> tolerance_mm,
                                                   CallOutcome& outcome) = 0;
  /// The model in force afterwards.
  [[nodiscard]] virtual Result<exchange::ModelInfo> activate(const CallFrom& from,
                                                             const CallAbout& about,
                                                             const Activation& change,
                                                             CallOutcome& outcome) = 0;

  /// The history of a cell, oldest first.
  [[nodiscard]] virtual Result<std::vector<exchange::ModelInfo>> models(const CallFrom& from,
                                                                        const CallAbout& about,
                                                                        CallOutcome& outcome) = 0;
  /// Without a cell, of every cell. `job` 0: the unfinished ones and the last finished ones.
  [[nodiscard]] virtual Result<std::vector<exchange::DatedJob>> jobs(const CallFrom& from,
                                                                     const CallAbout& about,
                                                                     std::int64_t job,
                                                                     CallOutcome& outcome) = 0;
  /// What a diagnosis or a check found: JSON, as `trammel diagnose --json` prints it.
  [[nodiscard]] virtual Result<std::string> findings(const CallFrom& from, const CallAbout& about,
                                                     std::int64_t job, CallOutcome& outcome) = 0;
  /// All cells: JSON, as `trammel fleet --json` prints it.
  [[nodiscard]] virtual Result<std::string> fleet(const CallFrom& from, CallOutcome& outcome) = 0;
};

}  // namespace trammel
