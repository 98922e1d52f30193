#pragma once

#include <memory>
#include <string>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/dds/dds_options.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

/// The service on DDS: answers the requests of idl/ and publishes the state topics. Owns the threads that work on
/// requests (DdsOptions::compute_workers for each of PredictError and CorrectTarget, one for each other operation) and
/// one that publishes its status every second; all stop in stop(). A watchdog ends the process where these or the
/// library's threads stop moving (watchdog.h). Thread-safe.
class DdsService {
 public:
  /// `trainer`, `store` and `registry` outlive the service.
  DdsService(DdsOptions options, Trainer& trainer, Store& store, const ModelRegistry& registry);
  ~DdsService();  ///< stops as stop()

  /// Begins to answer and publishes the models in force; after Trainer::take_up(). Refuses a port that is taken, an
  /// address that this host does not have, a server or cell name that does not fit the wire.
  [[nodiscard]] Status start();
  /// Lets running requests finish, says that it stops, and leaves. May be started again.
  void stop();

  /// Before start() and after stop(), these do nothing.
  void publish_progress(const JobProgress& progress);
  /// The model now in force for `cell`, whichever that is.
  void publish_model(const std::string& cell);

 private:
  class Running;
  /// `publish(running)` where the service runs. Without the lock: a large model holds nobody up.
  template <typename Publish>
  void publish(const Publish& publish);

  const DdsOptions options_;
  Trainer& trainer_;
  Store& store_;
  const ModelRegistry& registry_;
  Mutex mutex_;
  Condition published_;  // publishing_ has become less
  std::unique_ptr<Running> running_ TRAMMEL_GUARDED_BY(mutex_);
  int publishing_ TRAMMEL_GUARDED_BY(mutex_) = 0;  // threads that publish, each without the lock
};

}  // namespace trammel
