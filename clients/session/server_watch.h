#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/transport/state_reader.h"
#include "idl/transport/transport.h"
#include "server/base/mutex.h"

namespace trammel::client {

using Clock = std::chrono::steady_clock;

/// A server as its status describes it.
struct KnownServer {
  std::string participant;
  wire::ServiceStatus status;
  Clock::time_point heard;
  double written_s = 0;  ///< the time of the status, by the server's clock for its samples

  [[nodiscard]] std::string id() const { return status.server().to_string(); }
};

[[nodiscard]] bool serves(const KnownServer& server, const std::string& cell);

/// A server of another contract.
struct OtherServer {
  std::string id, program_version;
  std::uint32_t contract = 0;
};

/// A model in force, and the time of that description, by the server's clock for its samples.
struct KnownModel {
  wire::ModelInfo model;
  double written_s = 0;
};

/// The present servers, and their publications on the state topics. Thread-safe.
class ServerWatch {
 public:
  /// `named`: how many servers the client names.
  [[nodiscard]] static Result<std::unique_ptr<ServerWatch>> open(
      wire::dds::DomainParticipant& participant, wire::dds::Subscriber& subscriber,
      std::size_t named);

  /// Chooses among the servers that `reachable` accepts. It prefers one that serves `cell`, then
  /// one that published its status lately, then one that is not `avoid`, then one that was not
  /// slower than another lately (was_slow()). Waits until `deadline` for the first server, less if
  /// all present ones use another contract. A server without the cell is taken only if no other can
  /// be expected: all named servers are known, or kStatusLost is over.
  [[nodiscard]] std::optional<KnownServer> wait_for_server(
      const std::string& cell, const std::string& avoid, Clock::time_point deadline,
      const std::function<bool(const KnownServer&)>& reachable);
  /// wait_for_server() without waiting; never `avoid`, and never one that does not serve the cell.
  [[nodiscard]] std::optional<KnownServer> another_server(
      const std::string& cell, const std::string& avoid,
      const std::function<bool(const KnownServer&)>& reachable);
  /// Another server answered before this one: others are preferred until this one is heard of
  /// again.
  void was_slow(const std::string& server);
  /// The reason why no server is found, if the present ones all use another contract than this
  /// program.
  [[nodiscard]] std::optional<Error> other_contract() const;
  /// The mark that identifies the record of the server, even after it has left; empty: it has a
  /// record of its own.
  [[nodiscard]] std::string record_of(const std::string& server) const;
  /// Lets the time pass.
  void wait_until(Clock::time_point time);
  /// Call when the result of `reachable` may have changed: waiting calls look again.
  void wake();

  /// Waits until `count` servers are known, or until `deadline`. It waits for the others for half a
  /// status period after the first one, and only once. So a server that is down delays no later
  /// call.
  [[nodiscard]] std::vector<KnownServer> wait_for_servers(std::size_t count,
                                                          Clock::time_point deadline);
  /// Waits until the models in force are as many as the servers report, one status period at most.
  /// The age of their data is brought up to the present.
  [[nodiscard]] std::vector<wire::ModelInfo> models_in_force();

  /// Waits for progress of the job that is newer than number `seen`, and updates `seen`. Empty at
  /// `deadline`. An empty `server` means any.
  [[nodiscard]] std::optional<wire::Job> wait_for_progress(const std::string& server,
                                                           std::int64_t job, std::uint64_t& seen,
                                                           Clock::time_point deadline);

 private:
  explicit ServerWatch(std::size_t named) : named_(named) {}
  void on_contract(const wire::SpokenContract* spoken, const std::string& participant);
  /// True if waiting for a server is in vain: the present ones use another contract, and have done
  /// so for a while.
  [[nodiscard]] bool in_vain() const TRAMMEL_REQUIRES(mutex_);
  /// Waits until `found`, and gives up at `deadline` or when it is in vain.
  template <typename Found>
  void wait_for_first(MutexLock& lock, Clock::time_point deadline, const Found& found)
      TRAMMEL_REQUIRES(mutex_);
  void on_status(const wire::ServiceStatus* status, const std::string& participant,
                 double written_s);
  void on_model(const wire::ModelStatus* status, const std::string& participant, double written_s);
  void on_progress(const wire::TrainingProgress* progress);
  [[nodiscard]] const KnownServer* choose(
      const std::string& cell, const std::string& avoid,
      const std::function<bool(const KnownServer&)>& reachable) const TRAMMEL_REQUIRES(mutex_);
  /// True if `chosen` serves the cell, or no named server does.
  [[nodiscard]] bool is_settled(const KnownServer& chosen, const std::string& cell) const
      TRAMMEL_REQUIRES(mutex_);
  /// The time since that description of the model, by its server's clock alone, since other clocks
  /// may differ or be set.
  [[nodiscard]] double age_s(const std::string& participant, const KnownModel& known) const
      TRAMMEL_REQUIRES(mutex_);
  /// True if as many models of every server are known as it reports.
  [[nodiscard]] bool knows_all_models() const TRAMMEL_REQUIRES(mutex_);

  const std::size_t named_;
  mutable Mutex mutex_;
  Condition changed_;
  std::map<std::string, OtherServer> others_ TRAMMEL_GUARDED_BY(mutex_);  // by participant
  std::optional<Clock::time_point> others_since_ TRAMMEL_GUARDED_BY(mutex_);
  std::map<std::string, KnownServer> servers_ TRAMMEL_GUARDED_BY(mutex_);  // by id
  Clock::time_point others_expected_until_ TRAMMEL_GUARDED_BY(mutex_);
  std::map<std::string, std::string> records_
      TRAMMEL_GUARDED_BY(mutex_);  // by id, including servers that have left
  std::map<std::string, Clock::time_point> slow_ TRAMMEL_GUARDED_BY(mutex_);  // by id
  std::map<std::pair<std::string, std::string>, KnownModel> models_
      TRAMMEL_GUARDED_BY(mutex_);  // by participant and cell
  std::map<std::int64_t, std::map<std::string, std::pair<std::uint64_t, wire::Job>>> jobs_
      TRAMMEL_GUARDED_BY(mutex_);  // by number, then by server
  std::uint64_t progress_count_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::unique_ptr<wire::StateReader<wire::ServiceStatusTopic>> status_reader_;
  std::unique_ptr<wire::StateReader<wire::SpokenContractTopic>> contract_reader_;
  std::unique_ptr<wire::StateReader<wire::ModelStatusTopic>> model_reader_;
  std::unique_ptr<wire::StateReader<wire::TrainingProgressTopic>> progress_reader_;
};

}  // namespace trammel::client
