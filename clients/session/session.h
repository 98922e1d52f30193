#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

/// The DDS client that other programs link. Units as on the wire: mm, rad; a prismatic joint in mm. No Fast DDS type
/// appears here.
namespace trammel::client {

struct SessionOptions {
  std::uint32_t domain = 0;
  std::vector<std::uint16_t> server_ports = {17500};  ///< on 127.0.0.1, one a replica
  std::chrono::milliseconds timeout{5000};            ///< of one request, discovery included; long calls are several
};

/// What a call is about; must fit what the model was trained on.
struct CallContext {
  std::string cell;
  std::string tool;     ///< empty: the cell's only one
  std::string payload;  ///< empty: the cell's only one
  bool controller_compensates = false;
  std::string model;  ///< empty: the model in force; else `@version` or a model id that must be the one in force
};

struct PoseMm {
  double x_mm = 0, y_mm = 0, z_mm = 0;
  double qw = 1, qx = 0, qy = 0, qz = 0;
};

/// Which model answered.
struct ModelInfo {
  std::string cell, id, hash, level, batch_id;
  int version = 0;
  std::int64_t trained_at_unix_s = 0;
  double data_age_s = 0;  ///< of its newest measurement, now
  int training_poses = 0;
  double validation_rms_mm = 0;
  bool in_force = false;
};

struct PredictedError {
  PoseMm nominal, predicted;  ///< X_BT
  double dx_mm = 0, dy_mm = 0, dz_mm = 0;
  double sx_mm = 0, sy_mm = 0, sz_mm = 0;
  bool in_domain = false;
};

struct TargetMm {
  PoseMm pose;                   ///< ignored for a joint target
  std::vector<double> seed_rad;  ///< empty when `conf` says the branch
  std::optional<int> conf;
  bool joint_target = false;
};

struct CorrectedTarget {
  std::string status;  ///< `ok`, `out_of_domain`, ... as in files
  PoseMm commanded;
  std::vector<double> q_rad;
  double error_before_mm = 0, error_after_mm = 0, sigma_mm = 0;
  int iterations = 0;
  std::string message;
};

template <typename T>
struct Answer {
  ModelInfo model;  ///< all items come from this one
  std::vector<T> items;
};

struct JobStatus {
  std::int64_t job = 0;
  std::string cell, stage, what;  ///< stage: `queued training storing done failed`
  double share = 0;
  int model_version = 0;
  bool in_force = false;
};

/// A job with what was asked for and when; times are Unix time, s, empty: not yet, or not recorded.
struct DatedJob {
  JobStatus status;
  std::string server, kind;  ///< kind: `train diagnose`
  std::vector<std::string> batches;
  std::int64_t created_unix_s = 0;
  std::optional<std::int64_t> started_unix_s, finished_unix_s;
};

/// What a diagnosis found.
struct DiagnosisAnswer {
  std::string findings_json;  ///< as `trammel diagnose --json` prints them
  std::string page_html;      ///< opens by itself; empty where it was not asked for, or is too old
  ModelInfo in_force;         ///< now; empty id: none
};

/// A batch that no training takes, and why.
struct QuarantinedBatch {
  std::string cell, batch, reason;
  int poses = 0;
};

struct ServerStatus {
  std::string server_id, version, state;
  std::vector<std::string> cells;
  std::uint64_t requests = 0, refused = 0;
  double uptime_s = 0;
  int queued_jobs = 0;
};

/// One participant, its own reply partition. Thread-safe; calls from several threads overlap. Errors: kUnreachable when
/// no server answered in time, else what the server said, with its code. A request that is not answered is sent once
/// more with the same id: elsewhere, or to the same server where a repeat could change something twice.
class Session {
 public:
  /// Does not wait for a server. One session a process is enough.
  [[nodiscard]] static Result<std::unique_ptr<Session>> open(const SessionOptions& options);
  ~Session();

  /// Rows of joint vectors. Any number: long calls are sent in parts, and sent again when the model changed in between.
  [[nodiscard]] Result<Answer<PredictedError>> predict_error(const CallContext& context,
                                                             const std::vector<std::vector<double>>& joints_rad);
  /// Any number, as predict_error().
  [[nodiscard]] Result<Answer<CorrectedTarget>> correct_targets(const CallContext& context,
                                                                const std::vector<TargetMm>& targets);
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
