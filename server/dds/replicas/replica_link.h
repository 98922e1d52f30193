#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "idl/state_reader.h"
#include "server/base/mutex.h"
#include "server/dds/replicas/batch_sender.h"
#include "server/dds/replicas/replica_news.h"
#include "server/dds/replicas/replica_role.h"
#include "server/metrics/service_figures.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

/// The other servers of the same cells: who writes, and what followers load and store. DDS finds them, tells who has
/// left and brings models and batches; what is decided is in ReplicaRole, what is sent in BatchSender. Has a thread.
/// Thread-safe.
class ReplicaLink {
 public:
  /// Without a part among others (Role::kAlone) it is null: nobody is told of it. `snapshots` is the topic of
  /// ModelSnapshot. What else is given outlives it. From now on the trainer does what the part allows.
  [[nodiscard]] static Result<std::unique_ptr<ReplicaLink>> open(wire::dds::DomainParticipant& participant,
                                                                 wire::dds::Subscriber& subscriber,
                                                                 wire::dds::Topic& snapshots, const std::string& server,
                                                                 const ReplicaOptions& options, Trainer& trainer,
                                                                 Store& store, ReplicaListener listener);
  ~ReplicaLink();
  ReplicaLink(const ReplicaLink&) = delete;
  ReplicaLink& operator=(const ReplicaLink&) = delete;

  /// Whether a change is to be made elsewhere; empty: here.
  [[nodiscard]] std::optional<ChangesElsewhere> changes_elsewhere() const;
  /// A batch is stored here, or something has become of it: brings it to the followers, where the file asks for it, and
  /// waits for them. What could not be brought is said to the listener and in troubles(), and brought later.
  void bring_batch(const std::string& cell, const std::string& batch_id) { sender_.bring(cell, batch_id); }
  /// What is in force has changed here: it is told.
  void changed() { wake(); }
  /// The trainer serves more cells: what other servers have of them is asked for again. Call it from one thread.
  [[nodiscard]] Status cells_added();
  /// From now on no request waits for a follower longer than a second. Call it before you wait for the requests.
  void stop_copying() { sender_.stop(); }
  /// The server file was read again.
  void set_options(const ReplicaOptions& options);

  [[nodiscard]] ReplicaFigures figures() const;
  [[nodiscard]] std::vector<std::string> troubles() const;
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Heard {
    std::string participant;
    wire::ReplicaStatus status;
    Clock::time_point at;
  };
  struct Snapshot {
    std::string hash, text;
  };

  ReplicaLink(wire::dds::Subscriber& subscriber, std::string server, std::string participant,
              const ReplicaOptions& options, Trainer& trainer, Store& store, ReplicaListener listener);
  [[nodiscard]] Status open_endpoints(wire::dds::DomainParticipant& participant, wire::dds::Topic& snapshots);
  /// What was published before comes once more.
  [[nodiscard]] Status listen_to_snapshots();
  /// Whether the participant is the server's: no other one speaks for it.
  [[nodiscard]] bool is_its_own(const std::string& server, const std::string& participant) const
      TRAMMEL_REQUIRES(mutex_);
  [[nodiscard]] bool has_room_for(const wire::BatchCopy& copy) const TRAMMEL_REQUIRES(mutex_);
  /// False: the store does not let the part be remembered yet.
  [[nodiscard]] bool begin();

  // In threads of DDS.
  void on_status(const wire::ReplicaStatus* status, const std::string& participant);
  void on_snapshot(const wire::ModelSnapshot* snapshot);
  void on_copy(const wire::BatchCopy* copy, const std::string& participant);
  void on_copied(const wire::BatchCopied* copied, const std::string& participant);
  void wake();

  // In the thread of the replicas.
  void run(const std::stop_token& stop);
  void step();
  [[nodiscard]] std::vector<OtherReplica> others() const;
  [[nodiscard]] RoleDecision decide(const ReplicaRecord& record, const std::vector<OtherReplica>& others);
  void take_on(const RoleDecision& decision, const ReplicaRecord& before);
  void set_may_change(bool may);
  /// What is made here later gets higher numbers than any that they know of.
  void number_after(const std::vector<OtherReplica>& others, const ReplicaView& view);
  /// Puts in force what the leader has; returns what could not be, by cell.
  void follow(const OtherReplica& leader, const ReplicaView& view);
  [[nodiscard]] Status follow_cell(const std::string& cell, const VersionInForce& wanted, const std::string& leader);
  /// Of a stored model that cannot be loaded: its writer's snapshot replaces it. Returns why it is not served yet.
  [[nodiscard]] Status ask_again_for(const std::string& hash);
  /// Empty: it may still come.
  [[nodiscard]] std::string why_not_followed(const std::string& cell, const VersionInForce& wanted);
  /// Forgets snapshots of models that are stored here.
  void forget_known_snapshots();
  /// Stores batches that the writer sent.
  void keep_copies();
  void look_for_namesakes();
  void look_for_divergence(const std::vector<OtherReplica>& others, const ReplicaView& view);
  void publish(const ReplicaView& view);
  void tell_troubles();
  void set_trouble(const std::string& kind, const std::string& what);

  /// The followers that serve the cell: their participants by their names.
  [[nodiscard]] std::map<std::string, std::string> followers_of(const std::string& cell) const;

  wire::dds::Subscriber& subscriber_;
  const std::string server_, participant_;
  Trainer& trainer_;
  Store& store_;
  const ReplicaListener listener_;
  wire::dds::Topic* snapshots_topic_ = nullptr;
  wire::dds::Publisher* publisher_ = nullptr;
  wire::dds::DataWriter* status_writer_ = nullptr;
  wire::dds::DataWriter* copy_writer_ = nullptr;
  wire::dds::DataWriter* copied_writer_ = nullptr;
  std::atomic<std::uint64_t> epoch_{0};

  Mutex listening_;  // while the reader of snapshots is made anew
  mutable Mutex mutex_;
  mutable Condition changed_;
  BatchSender sender_;
  bool woken_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::map<std::string, Heard> heard_ TRAMMEL_GUARDED_BY(mutex_);                                 // by server
  std::map<std::pair<std::string, std::string>, Snapshot> snapshots_ TRAMMEL_GUARDED_BY(mutex_);  // by server and cell
  std::deque<wire::BatchCopy> arrived_ TRAMMEL_GUARDED_BY(mutex_);
  std::set<std::string> namesakes_ TRAMMEL_GUARDED_BY(mutex_);              // participants of servers of the same name
  std::map<std::string, std::string> troubles_ TRAMMEL_GUARDED_BY(mutex_);  // by kind
  ReplicaRole role_ TRAMMEL_GUARDED_BY(mutex_);
  ReplicaRecord record_ TRAMMEL_GUARDED_BY(mutex_);  // as it is stored
  bool may_change_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::optional<ReplicaOptions> new_options_ TRAMMEL_GUARDED_BY(mutex_);

  // Of the thread of the replicas.
  bool begun_ = false;
  std::map<std::string, std::pair<std::string, Error>> not_followed_;  // by cell: the hash, and why
  std::set<std::string> not_loaded_;                                   // hashes of stored models that are damaged
  std::map<std::string, Clock::time_point> awaited_since_;             // models, by cell and hash
  std::optional<ReplicaNews> new_part_;                                // not told yet
  std::map<std::string, Clock::time_point> divergent_since_;           // by server and cell
  std::vector<std::string> told_;
  std::optional<wire::ReplicaStatus> published_;
  Clock::time_point published_at_;

  // Readers first deleted, threads last made.
  std::unique_ptr<wire::StateReader<wire::ReplicaStatusTopic>> status_reader_;
  std::unique_ptr<wire::StateReader<wire::ModelSnapshotTopic>> snapshot_reader_;
  std::unique_ptr<wire::StateReader<wire::BatchCopyTopic>> copy_reader_;
  std::unique_ptr<wire::StateReader<wire::BatchCopiedTopic>> copied_reader_;
  std::jthread replicas_thread_;
};

}  // namespace trammel
