#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <tuple>

#include "idl/transport.h"
#include "server/base/mutex.h"
#include "server/dds/dds_options.h"
#include "server/dds/replicas/batch_copies.h"
#include "server/dds/replicas/replica_news.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

/// Brings the batches of the server that writes to its followers, and what becomes of them: quarantine, release,
/// discard, models made of them. Has a thread, which brings what was not brought at once. Thread-safe.
class BatchSender {
 public:
  /// The followers that serve a cell: their participants by their names.
  using Followers = std::function<std::map<std::string, std::string>(const std::string& cell)>;
  /// What followers may lack; empty: nothing.
  using Trouble = std::function<void(const std::string& trouble)>;

  /// `trainer` and `store` outlive it. The listener is told of what a change could not bring at once.
  BatchSender(std::string server, const ReplicaOptions& options, const Trainer& trainer, const Store& store,
              Followers followers, Trouble trouble, ReplicaListener listener);
  ~BatchSender();  ///< stops as stop()
  BatchSender(const BatchSender&) = delete;
  BatchSender& operator=(const BatchSender&) = delete;

  /// From now on it sends; the writer outlives it, or is there until stop().
  void start(wire::dds::DataWriter& writer);
  void stop();
  void set_options(const ReplicaOptions& options);
  /// Whether this server writes: only then is anything sent.
  void set_writes(bool writes);
  /// Somebody may lack what others have: all is looked at again.
  void look_again();
  /// Brings a batch as it is stored here now, and waits for the followers. Nothing where the file does not ask for it.
  void bring(const std::string& cell, const std::string& batch_id);
  /// A follower's answer.
  void answered(const std::string& follower, std::uint64_t number, const Status& outcome) {
    copies_.answered(follower, number, outcome);
  }

 private:
  /// What a participant has said of a batch.
  struct Said {
    std::string standing;          ///< as it was told of it then
    std::optional<Error> refused;  ///< empty: it has taken it
  };
  using Key = std::tuple<std::string, std::string, std::string>;  ///< participant, cell, batch

  void run(const std::stop_token& stop);
  /// All batches to all followers; returns what is not there, and whether it may be there if it is tried again.
  struct Missing {
    std::map<std::string, std::string> why;  ///< by follower
    bool try_again = false;
  };
  [[nodiscard]] Missing bring_all(const std::stop_token& stop);
  /// To those of them that have not said that they have it so; what is wrong by follower.
  [[nodiscard]] std::map<std::string, Error> bring(const std::map<std::string, std::string>& followers,
                                                   const StoredBatch& batch);
  [[nodiscard]] bool sends() const TRAMMEL_REQUIRES(mutex_) { return writes_ && options_.batches_to_followers; }

  const std::string server_;
  const Trainer& trainer_;
  const Store& store_;
  const Followers followers_;
  const Trouble trouble_;
  const ReplicaListener listener_;
  BatchCopies copies_;

  mutable Mutex mutex_;
  Condition changed_;
  wire::dds::DataWriter* writer_ TRAMMEL_GUARDED_BY(mutex_) = nullptr;
  ReplicaOptions options_ TRAMMEL_GUARDED_BY(mutex_);
  bool writes_ TRAMMEL_GUARDED_BY(mutex_) = false;
  bool look_again_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::map<Key, Said> said_ TRAMMEL_GUARDED_BY(mutex_);

  std::jthread thread_;  // the last member: stops first
};

}  // namespace trammel
