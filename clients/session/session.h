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
  std::vector<std::uint16_t> server_ports = {17500};  ///< on `address`, one for each server
  std::chrono::milliseconds timeout{
      5000};  ///< for one request, discovery included; a long call is many requests
  std::string address =
      "127.0.0.1";  ///< IPv4 on which the servers listen, one of this host's; else kUsage
  /// Servers anywhere. If there are some, `server_ports` and `address` are ignored, and the
  /// interface is the one on the route to the first of them.
  std::vector<HostPort> servers = {};
  /// They announce more servers; position = number. open() asks them, for at most half the timeout.
  std::vector<HostPort> discovery_servers = {};
  /// Folder with the certificate, key and permissions for DDS-Security (deploy/security/README.md);
  /// empty: without. Calls beyond the permissions are kRefused.
  std::string security = {};
};

/// The subject of the certificate in a folder of SessionOptions::security. Refuses the same folders
/// as a session, with the reason.
[[nodiscard]] Result<std::string> check_security(const std::string& folder);

/// One DDS participant with its own reply partition. Thread-safe; calls from several threads
/// overlap. Errors: kUnreachable if no server answered in time, else the error of the server. A
/// request without an answer is sent once more with the same id, preferably to another server. A
/// change goes to the same server again, which recognises the repeat, even after a restart. A
/// server of another contract is kRefused (contract_version).
class Session {
 public:
  /// Does not wait for a server, but for the first one that a discovery server announces;
  /// kUnreachable: there is none, and none was named. One session per process is enough.
  [[nodiscard]] static Result<std::unique_ptr<Session>> open(const SessionOptions& options);
  ~Session();

  /// Receives the answered share of a long call, [0, 1]; it falls when the call begins again.
  using ShareListener = std::function<void(double share)>;
  /// Takes any number of joint vectors. A long call is sent in parts, each answered in a small
  /// share of the timeout. One model answers all parts: if the model changes meanwhile, the call
  /// starts again with the new one.
  [[nodiscard]] Result<exchange::Answer<exchange::Prediction>> predict_error(
      const CallContext& context, const std::vector<std::vector<double>>& joints_rad,
      const ShareListener& progress = {});
  /// predict_error() with the known approach of the arm.
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
  /// `tolerance_mm`: NaN means the cell file's. Returns the job; when it is done, diagnosis()
  /// returns the output of `trammel check --json`.
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
  /// recently ended ones.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell);
  /// A waiting job does not begin; a running one stops as soon as it can. kConflict: it has ended.
  /// kRefused: several servers have a job of this number.
  [[nodiscard]] Status cancel(std::int64_t job);
  /// From every server: the changes and their authors, for one cell or (empty) for all, since then
  /// (Unix time, s), the newest `most` (0: all).
  [[nodiscard]] Result<std::vector<AuditText>> audit(const std::string& cell,
                                                     std::int64_t since_unix_s, std::size_t most);
  /// From every server: its cells, their health, and the unusual values of each, as `trammel fleet
  /// --json` prints them.
  [[nodiscard]] Result<std::vector<std::string>> fleet();
  /// From every server: the results of the checks of a cell or (empty) of all, the newest `most` of
  /// each (0: all), the date of the next check, and the verdict on the model in force: JSON,
  /// `cells` with an entry each.
  [[nodiscard]] Result<std::vector<std::string>> health(const std::string& cell, std::size_t most);
  [[nodiscard]] Result<std::vector<exchange::ModelInfo>> models(const std::string& cell);
  /// Returns the version now in force.
  [[nodiscard]] Result<int> activate(const std::string& cell, int version,
                                     const ChangeOptions& change = {});
  [[nodiscard]] Result<int> rollback(const std::string& cell, const ChangeOptions& change = {});
  /// The recently requested poses of a cell, by its model in force and by `version` (0: none), as
  /// `trammel replay --json` prints them. From the server that answers.
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
  /// servers have a job of this number, and this session waits for several of them. If the server
  /// restarts meanwhile, the call waits for it.
  [[nodiscard]] Result<JobStatus> wait_for_job(
      std::int64_t job, std::chrono::milliseconds limit,
      const std::function<void(const JobStatus&)>& listener);

 private:
  struct Participant;
  explicit Session(std::unique_ptr<Participant> participant);
  std::unique_ptr<Participant> participant_;
};

}  // namespace trammel::client
