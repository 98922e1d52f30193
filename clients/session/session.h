#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/session/session_types.h"
#include "server/base/result.h"

/// The DDS client that other programs link. No Fast DDS type appears here.
namespace trammel::client {

struct SessionOptions {
  std::uint32_t domain = 0;
  std::vector<std::uint16_t> server_ports = {17500};  ///< on 127.0.0.1, one a replica
  std::chrono::milliseconds timeout{5000};            ///< of one request, discovery included; long calls are many
};

/// One participant, its own reply partition. Thread-safe; calls from several threads overlap. Errors: kUnreachable when
/// no server answered in time, else what the server said, with its code. A request that is not answered is sent once
/// more with the same id: elsewhere, or to the same server where a repeat could change something twice.
class Session {
 public:
  /// Does not wait for a server. One session a process is enough.
  [[nodiscard]] static Result<std::unique_ptr<Session>> open(const SessionOptions& options);
  ~Session();

  /// The share of a long call that is answered, [0, 1]; it falls where the call begins again.
  using ShareListener = std::function<void(double share)>;
  /// Rows of joint vectors. Any number: long calls are sent in parts that are answered in a small share of the timeout.
  /// One model answers all of them: where it changes in between, the call begins again with the new one.
  [[nodiscard]] Result<Answer<PredictedError>> predict_error(const CallContext& context,
                                                             const std::vector<std::vector<double>>& joints_rad,
                                                             const ShareListener& progress = {});
  /// Any number, as predict_error().
  [[nodiscard]] Result<Answer<CorrectedTarget>> correct_targets(const CallContext& context,
                                                                const std::vector<TargetMm>& targets,
                                                                const ShareListener& progress = {});
  /// The CSV as it is on disk. Returns the job. A repeat after a lost answer is the same request to the server.
  [[nodiscard]] Result<std::int64_t> submit_measurements(const std::string& cell, const std::string& batch_id,
                                                         const std::string& csv);
  [[nodiscard]] Result<std::int64_t> train(const std::string& cell, const std::vector<std::string>& batch_ids,
                                           const std::string& level, const std::string& bias);
  /// Queues a diagnosis of a stored batch (empty: the newest) or of `csv`; with `apply` what is found is trained and
  /// put in force if better. Returns the job; when that is done, diagnosis() is what it found.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell, const std::string& batch_id,
                                              const std::string& csv, bool apply);
  [[nodiscard]] Result<DiagnosisAnswer> diagnosis(const std::string& cell, std::int64_t job, bool page);
  /// Of every server, of one cell or (empty) of all.
  [[nodiscard]] Result<std::vector<QuarantinedBatch>> quarantine(const std::string& cell);
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id);
  /// As train(), from batches that leave quarantine with it: only if the training is accepted.
  [[nodiscard]] Result<std::int64_t> release_and_train(const std::string& cell,
                                                       const std::vector<std::string>& batch_ids,
                                                       const std::string& level, const std::string& bias);
  /// Of every server, of one cell or (empty) of all, oldest first: what waits or runs and what ended lately.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell);
  [[nodiscard]] Result<std::vector<ModelInfo>> models(const std::string& cell);
  /// Returns the version now in force.
  [[nodiscard]] Result<int> activate(const std::string& cell, int version);
  [[nodiscard]] Result<int> rollback(const std::string& cell);
  /// The model file's text. version 0 = in force.
  [[nodiscard]] Result<std::string> export_model(const std::string& cell, int version);
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text);

  /// Those that are there, by their last status, waiting up to the timeout for the first to appear.
  [[nodiscard]] Result<std::vector<ServerStatus>> servers();
  /// Models in force, of every cell, from ModelStatus.
  [[nodiscard]] Result<std::vector<ModelInfo>> model_status();
  /// Calls `listener` for the job's progress until it is done or failed (its last state is returned) or `limit` is over
  /// (kUnreachable). A server that restarts meanwhile is waited for. kNotFound: no server knows the job.
  [[nodiscard]] Result<JobStatus> wait_for_job(std::int64_t job, std::chrono::milliseconds limit,
                                               const std::function<void(const JobStatus&)>& listener);

 private:
  struct Participant;
  explicit Session(std::unique_ptr<Participant> participant);
  std::unique_ptr<Participant> participant_;
};

}  // namespace trammel::client
