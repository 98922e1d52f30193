#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/session/session_types.h"
#include "server/base/host_port.h"
#include "server/base/result.h"

/// The DDS client that other programs link. No Fast DDS type appears here.
namespace trammel::client {

struct SessionOptions {
  std::uint32_t domain = 0;
  std::vector<std::uint16_t> server_ports = {17500};  ///< on `address`, one per server
  std::chrono::milliseconds timeout{
      5000};  ///< of one request, discovery included; a long call is many requests
  std::string address =
      "127.0.0.1";  ///< IPv4 that the servers listen on, one of this host's; else kUsage
  /// Servers anywhere. Where there are some, `server_ports` and `address` are not looked at, and
  /// the interface is the one that leads to the first of them.
  std::vector<HostPort> servers = {};
  /// They tell of more servers; position = number. open() asks them, for at most half the timeout.
  std::vector<HostPort> discovery_servers = {};
  /// Folder with the certificate, key and permissions that DDS-Security asks for
  /// (deploy/security/README.md); empty: without. What the permissions do not allow is kRefused.
  std::string security = {};
};

/// The subject of the certificate in a folder of SessionOptions::security. Refuses what a session
/// would refuse there, with the reason.
[[nodiscard]] Result<std::string> check_security(const std::string& folder);

/// One DDS participant with its own reply partition. Thread-safe; calls from several threads
/// overlap. Errors: kUnreachable when no server answered in time, else the error of the server. A
/// request without an answer is sent once more with the same id, preferably to another server. A
/// request that changes something goes to the same server again, which recognises the repeat, also
/// after a restart. A server of another contract is kRefused (contract_version).
class Session {
 public:
  /// Does not wait for a server, but for the first that a discovery server tells of; kUnreachable:
  /// there is none, and none was named. One session per process is enough.
  [[nodiscard]] static Result<std::unique_ptr<Session>> open(const SessionOptions& options);
  ~Session();

  /// The share of a long call that is answered, [0, 1]; it falls where the call begins again.
  using ShareListener = std::function<void(double share)>;
  /// Takes any number of joint vectors. A long call is sent in parts, each answered in a small
  /// share of the timeout. One model answers all parts: if the model changes meanwhile, the call
  /// starts again with the new one.
  [[nodiscard]] Result<exchange::Answer<exchange::Prediction>> predict_error(
      const CallContext& context, const std::vector<std::vector<double>>& joints_rad,
      const ShareListener& progress = {});
  /// predict_error() with what is known of how the arm comes there.
  [[nodiscard]] Result<exchange::Answer<exchange::Prediction>> predict_error_at(
      const CallContext& context, const std::vector<exchange::AskedJoints>& poses,
      const ShareListener& progress = {});
  /// Any number, as predict_error().
  [[nodiscard]] Result<exchange::Answer<exchange::CorrectedTarget>> correct_targets(
      const CallContext& context, const std::vector<exchange::AskedTarget>& targets,
      const ShareListener& progress = {});
  /// The CSV as it is on disk. Returns the job. A repeat after a lost answer is the same request to
  /// the server.
  [[nodiscard]] Result<std::int64_t> submit_measurements(const std::string& cell,
                                                         const std::string& batch_id,
                                                         const std::string& csv);
  [[nodiscard]] Result<std::int64_t> train(const std::string& cell,
                                           const std::vector<std::string>& batch_ids,
                                           const std::string& level, const std::string& bias,
                                           const ChangeOptions& change = {});
  /// Queues a diagnosis of a stored batch (empty: the newest) or of `csv`. With `apply` a model
  /// with the causes found is trained, and put in force if better. Returns the job; when that is
  /// done, diagnosis() returns the findings.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell, const std::string& batch_id,
                                              const std::string& csv, bool apply,
                                              const ChangeOptions& change = {});
  /// Queues a health check of a stored batch or of `csv` against the model in force;
  /// `tolerance_mm`: NaN as the cell file says. Returns the job; when that is done, diagnosis()
  /// returns what `trammel check --json` prints.
  [[nodiscard]] Result<std::int64_t> check_health(const std::string& cell,
                                                  const std::string& batch_id,
                                                  const std::string& csv, double tolerance_mm,
                                                  const ChangeOptions& change = {});
  [[nodiscard]] Result<DiagnosisAnswer> diagnosis(const std::string& cell, std::int64_t job,
                                                  bool page);
  /// From every server, for one cell or (empty) for all.
  [[nodiscard]] Result<std::vector<BatchOfService>> quarantine(const std::string& cell);
  /// All that the servers have, as quarantine(), oldest first.
  [[nodiscard]] Result<std::vector<BatchOfService>> batches(const std::string& cell);
  /// The batch's text as it came.
  [[nodiscard]] Result<std::string> export_batch(const std::string& cell,
                                                 const std::string& batch_id);
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id,
                               const ChangeOptions& change = {});
  /// Nothing takes the batch any more.
  [[nodiscard]] Status discard(const std::string& cell, const std::string& batch_id,
                               const ChangeOptions& change = {});
  /// As train(), from batches in quarantine. They are released only if the training is accepted.
  [[nodiscard]] Result<std::int64_t> release_and_train(const std::string& cell,
                                                       const std::vector<std::string>& batch_ids,
                                                       const std::string& level,
                                                       const std::string& bias,
                                                       const ChangeOptions& change = {});
  /// From every server, for one cell or (empty) for all, oldest first: jobs that wait or run, and
  /// jobs that ended lately.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell);
  /// A job that waits is not begun, one that runs stops as soon as it can. kConflict: it is over.
  /// kRefused: several servers have a job of this number.
  [[nodiscard]] Status cancel(std::int64_t job);
  /// From every server: who changed what, of one cell or (empty) of all, since then (Unix time, s),
  /// the newest `most` (0: all).
  [[nodiscard]] Result<std::vector<AuditText>> audit(const std::string& cell,
                                                     std::int64_t since_unix_s, std::size_t most);
  /// From every server: its cells, their health, what is unusual about each, as `trammel fleet
  /// --json` prints it.
  [[nodiscard]] Result<std::vector<std::string>> fleet();
  /// From every server: what checks said of a cell or (empty) of all, the newest `most` of each (0:
  /// all), when the next one is due, and how what is in force was judged: JSON, `cells` with an
  /// entry each.
  [[nodiscard]] Result<std::vector<std::string>> health(const std::string& cell, std::size_t most);
  [[nodiscard]] Result<std::vector<exchange::ModelInfo>> models(const std::string& cell);
  /// Returns the version now in force.
  [[nodiscard]] Result<int> activate(const std::string& cell, int version,
                                     const ChangeOptions& change = {});
  [[nodiscard]] Result<int> rollback(const std::string& cell, const ChangeOptions& change = {});
  /// The poses that a cell was lately asked for, by its model in force and by `version` beside it
  /// (0: none), as `trammel replay --json` prints it. Of the server that answers.
  [[nodiscard]] Result<std::string> replay(const std::string& cell, int version);
  /// The model file's text. version 0 = in force.
  [[nodiscard]] Result<std::string> export_model(const std::string& cell, int version);
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text,
                                         const ChangeOptions& change = {});

  /// The servers that are there, by their last status. Waits up to the timeout for the first.
  [[nodiscard]] Result<std::vector<ServerStatus>> servers();
  /// servers() once `holds` for them, or after `limit`.
  [[nodiscard]] Result<std::vector<ServerStatus>> servers_when(
      const std::function<bool(const std::vector<ServerStatus>&)>& holds,
      std::chrono::milliseconds limit);
  /// Models in force, of every cell, from ModelStatus.
  [[nodiscard]] Result<std::vector<exchange::ModelInfo>> model_status();
  /// Calls `listener` with the job's progress until it is done or failed, and returns its last
  /// state. kUnreachable: `limit` is over. kNotFound: no server knows the job. kRefused: several
  /// servers have a job of this number, and it is not the only one that this session waits for. If
  /// the server restarts meanwhile, the call waits for it.
  [[nodiscard]] Result<JobStatus> wait_for_job(
      std::int64_t job, std::chrono::milliseconds limit,
      const std::function<void(const JobStatus&)>& listener);

 private:
  struct Participant;
  explicit Session(std::unique_ptr<Participant> participant);
  std::unique_ptr<Participant> participant_;
};

}  // namespace trammel::client
