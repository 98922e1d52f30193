#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

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
  /// Sends a copy; one at a time.
  using Send = std::function<void(wire::BatchCopy& copy)>;

  /// `trainer` and `store` outlive it. The listener is told of what a change could not bring at once.
  BatchSender(std::string server, const ReplicaOptions& options, const Trainer& trainer, const Store& store,
              Followers followers, Trouble trouble, ReplicaListener listener);
  ~BatchSender();  ///< stops as stop()
  BatchSender(const BatchSender&) = delete;
  BatchSender& operator=(const BatchSender&) = delete;

  /// From now on it sends.
  void start(Send send);
  /// Ends the thread. From now on nobody waits for a follower longer than a second.
  void stop();
  void set_options(const ReplicaOptions& options);
  /// Whether this server writes: only then is anything sent. One that begins to write tells all that became of each
  /// batch once more: another one may have told something else meanwhile.
  void set_writes(bool writes);
  /// Somebody may lack what others have: all is looked at again.
  void look_again();
  /// The same; this participant may have been told something else by another server.
  void look_again(const std::string& participant);
  /// Brings a batch as it is stored here now, and waits for the followers. Nothing where the file does not ask for it.
  void bring(const std::string& cell, const std::string& batch_id);
  /// A follower's answer.
  void answered(const std::string& participant, const wire::BatchCopied& answer);

 private:
  void run(const std::stop_token& stop);
  /// All batches to all followers; returns what is not there, and whether it may be there if it is tried again.
  struct Missing {
    std::map<std::string, std::string> why;  ///< by follower
    bool try_again = false;
  };
  [[nodiscard]] Missing bring_all(const std::stop_token& stop);
  /// To those of them that have not said that they have it so; what is wrong by follower. `seen`: as it was when it was
  /// looked at; it is sent as it is now.
  [[nodiscard]] std::map<std::string, Error> bring(const std::map<std::string, std::string>& followers,
                                                   const StoredBatch& seen);
  void tell(const std::map<std::string, BatchCopies::Key>& followers, const StoredBatch& seen);
  void send_to(const std::map<std::string, BatchCopies::Key>& followers, const StoredBatch& batch)
      TRAMMEL_REQUIRES(sending_);
  [[nodiscard]] bool sends() const;

  const std::string server_;
  const Trainer& trainer_;
  const Store& store_;
  const Followers followers_;
  const Trouble trouble_;
  const ReplicaListener listener_;
  BatchCopies copies_;

  Mutex sending_;  // from the look at what is stored until it is sent: what is sent later is never of an older state
  Send send_ TRAMMEL_GUARDED_BY(sending_);

  mutable Mutex mutex_;  // taken last
  Condition changed_;
  ReplicaOptions options_ TRAMMEL_GUARDED_BY(mutex_);
  bool writes_ TRAMMEL_GUARDED_BY(mutex_) = false;
  bool look_again_ TRAMMEL_GUARDED_BY(mutex_) = false;

  std::jthread thread_;  // the last member: stops first
};

}  // namespace trammel
