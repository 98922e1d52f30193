#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trammel/result.h"
#include "trammel/types.h"

/// The client of the service.
namespace trammel::api {

/// The place of the service.
struct SessionOptions {
  std::uint32_t domain = 0;  ///< DDS domain, 0 to 232
  std::vector<std::uint16_t> ports = {
      17500};  ///< UDP ports on each host that is named without one, one per server
  std::chrono::milliseconds timeout{5000};  ///< of one request, discovery included
  /// The hosts of the service, names or IPv4 addresses, with `:port` behind them or not. Empty:
  /// this host, on 127.0.0.1.
  std::vector<std::string> hosts = {};
  /// Folder with the certificate, key and permissions that a secured service asks for; empty:
  /// without.
  std::string security = {};
  /// Discovery servers that tell where more servers are, as `host` or `host:port`; their order is
  /// their number. At most half the timeout is waited for them.
  std::vector<std::string> discovery_servers = {};
};

/// The subject of a call.
struct Asked {
  std::string cell;                     ///< name of the cell
  Context context;                      ///< the load of its arm, and its approach
  bool controller_compensates = false;  ///< true: the controller already corrects by itself
};

/// Answers, all from one model.
template <typename T>
struct Answer {
  ModelFacts model;      ///< the one that answered
  std::vector<T> items;  ///< one for each asked
};

/// A job of a service.
struct Job {
  std::int64_t id = 0;  ///< its number
  std::string cell;     ///< its cell
  std::string stage;    ///< `queued training storing done failed`
  std::string what;     ///< the current step, or the outcome
  double share = 0;     ///< done of all, [0, 1]
  std::string
      verdict;  ///< `open in_force not_better undecided diagnosed quarantined refused broken ...`
  int version = 0;        ///< of the resulting model; 0: none
  bool in_force = false;  ///< true if that model serves its cell
  std::string why;        ///< for a job that made no model
  std::string next;       ///< the next step for the user, as one clause
  std::string held_back;  ///< why a person decides about it: `few_judges stop_note step_limit`;
                          ///< empty: the poses held out decide
};

/// A batch that a service has.
struct StoredBatch {
  std::string cell;                  ///< its cell
  std::string id;                    ///< its name
  std::string kept_out;              ///< why nothing learns from it; empty: it is not kept out
  std::string hash;                  ///< SHA-256 of its text
  std::string server;                ///< the server that states this
  int poses = 0;                     ///< how many it has
  std::int64_t accepted_unix_s = 0;  ///< when it came, Unix time, s
  bool learned = false;              ///< later trainings may learn from it
};

/// A server, by its last status.
struct Server {
  std::string id;                  ///< its name
  std::string version;             ///< of its program
  std::string state;               ///< its current activity
  std::vector<std::string> cells;  ///< the cells that it serves
  std::string trouble;             ///< its present trouble and the reason; empty: none
  double uptime_s = 0;             ///< since its start, s
  int queued_jobs = 0;             ///< the waiting ones
};

/// One client of the service; one per process is enough. Thread-safe; calls from several threads
/// overlap. A request without an answer is sent once more with the same id, so a change happens
/// once. Errors: kUnreachable if no server answered in time, else the server's.
class TRAMMEL_API Session {
 public:
  /// Does not wait for a server.
  [[nodiscard]] static Result<Session> open(const SessionOptions& options = {});
  /// Takes over.
  Session(Session&&) noexcept;
  /// Takes over.
  Session& operator=(Session&&) noexcept;
  /// Leaves the network.
  ~Session();

  /// The servers that are there. Waits up to the timeout for the first.
  [[nodiscard]] Result<std::vector<Server>> servers() const;
  /// The models of a cell; empty: those in force, of all cells.
  [[nodiscard]] Result<std::vector<ModelFacts>> models(const std::string& cell) const;
  /// The text of a model file, for Model::parse(); version 0: in force.
  [[nodiscard]] Result<std::string> export_model(const std::string& cell, int version = 0) const;

  /// As Model::predict(), by the model in force: N x n values, deg; of a rail mm.
  [[nodiscard]] Result<Answer<Prediction>> predict(const Asked& asked,
                                                   std::span<const double> joints_deg) const;
  /// As Model::correct(), by the model in force.
  [[nodiscard]] Result<Answer<CorrectedTarget>> correct(const Asked& asked,
                                                        std::span<const Target> targets) const;

  /// Hands in measurements (CSV), from which the service trains. Returns the job. The same id with
  /// the same content is the same submission.
  [[nodiscard]] Result<std::int64_t> submit(const std::string& cell, const std::string& batch_id,
                                            const std::string& csv) const;
  /// Trains from stored batches (empty: the newest) and returns the job. `level` and `bias`
  /// override the cell's; empty: the cell's.
  [[nodiscard]] Result<std::int64_t> retrain(const std::string& cell,
                                             const std::vector<std::string>& batch_ids = {},
                                             const std::string& level = {},
                                             const std::string& bias = {}) const;
  /// Diagnoses what the cell's model lacks, from a stored batch (its id; empty: the newest) or,
  /// with `csv`, from measurements that are not kept. Returns the job; once it is done, findings()
  /// has the output of `trammel diagnose --json`. With `apply` a model with the causes found is
  /// trained, and put in force if it is better.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell,
                                              const std::string& batch_id = {},
                                              const std::string& csv = {},
                                              bool apply = false) const;
  /// Checks with a few poses, stored or in `csv`, whether the robot is still as its model in force
  /// has it. `tolerance_mm` overrides the cell's. Returns the job; then findings() has the output
  /// of `trammel check --json`.
  [[nodiscard]] Result<std::int64_t> check(const std::string& cell,
                                           const std::string& batch_id = {},
                                           const std::string& csv = {},
                                           std::optional<double> tolerance_mm = {}) const;
  /// The findings of a diagnosis or a check that is done: JSON.
  [[nodiscard]] Result<std::string> findings(const std::string& cell, std::int64_t job) const;
  /// Waits until the job is done or failed, and reports its progress to `listener`, if any.
  /// kUnreachable: `limit` is over. kNotFound: no server knows it.
  [[nodiscard]] Result<Job> wait_for(std::int64_t job, std::chrono::milliseconds limit,
                                     const std::function<void(const Job&)>& listener = {}) const;
  /// Jobs that wait or run or ended lately, of one cell or (empty) of all, oldest first.
  [[nodiscard]] Result<std::vector<Job>> jobs(const std::string& cell) const;
  /// A waiting job does not begin; a running one stops as soon as it can. kConflict: it has ended.
  [[nodiscard]] Status cancel(std::int64_t job) const;
  /// The batches of one cell or (empty) of all, oldest first.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;
  /// A batch's text as it came.
  [[nodiscard]] Result<std::string> export_batch(const std::string& cell,
                                                 const std::string& batch_id) const;
  /// The changes and their authors, for one cell or (empty) for all, since then (Unix time, s), the
  /// newest `most` (0: all): JSON of each server, as `trammel audit --json` has its `trails`.
  [[nodiscard]] Result<std::vector<std::string>> audit(const std::string& cell,
                                                       std::int64_t since_unix_s = 0,
                                                       std::size_t most = 0) const;
  /// Puts a version in force. Refused if `expected_version` is not in force. Refused, unless
  /// `force` is set, if it is worse than the version in force or cannot be judged. `reason` is for
  /// the audit trail.
  [[nodiscard]] Result<int> activate(const std::string& cell, int version,
                                     const std::string& reason = {},
                                     std::optional<int> expected_version = {},
                                     bool force = false) const;
  /// Adds a model file's text to the history of its cell; activate() puts it in force. Returns its
  /// version.
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text) const;
  /// Puts the version before in force again, and returns it; refused where `expected_version` is
  /// not in force.
  [[nodiscard]] Result<int> roll_back(const std::string& cell, const std::string& reason = {},
                                      std::optional<int> expected_version = {}) const;
  /// Releases a batch from quarantine, so that models may learn from it. Refused if
  /// `expected_version` is not in force.
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id,
                               const std::string& reason = {},
                               std::optional<int> expected_version = {}) const;
  /// Nothing learns from the batch any more; refused where `expected_version` is not in force.
  [[nodiscard]] Status discard(const std::string& cell, const std::string& batch_id,
                               const std::string& reason = {},
                               std::optional<int> expected_version = {}) const;

 private:
  struct Inside;
  explicit Session(std::unique_ptr<Inside> inside);
  std::unique_ptr<Inside> inside_;
};

}  // namespace trammel::api
