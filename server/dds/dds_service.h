#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/dds/call_report.h"
#include "server/dds/dds_options.h"
#include "server/dds/gateway/service_calls.h"
#include "server/metrics/service_figures.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

/// Checks the folder of certificates and permissions as start() would (idl/transport/security.h);
/// an empty name is accepted.
[[nodiscard]] Status check_security(const std::string& folder);
/// Checks that requests can be recorded there; makes nothing.
[[nodiscard]] Status check_records(const RecordOptions& options);

/// Receives an event, `packets_dropped` or `participant_refused`, and a sentence.
using PacketListener = std::function<void(const char* event, const std::string& what)>;

/// The service on DDS: answers the requests of idl/ and publishes the state topics. It owns several
/// threads. Worker threads handle requests (schedule/lane.h: DdsOptions::compute_workers for each
/// of PredictError and CorrectTarget, some for reading and some for changes). One thread sends
/// replies that had to wait, and one publishes the status every second. stop() ends them all. A
/// watchdog ends the process if these threads or the library's hang (watchdog.h). Thread-safe.
class DdsService {
 public:
  /// `trainer`, `store` and `registry` outlive the service.
  DdsService(DdsOptions options, Trainer& trainer, Store& store, const ModelRegistry& registry);
  ~DdsService();  ///< stops as stop()

  /// Called with an event and a sentence for the log when packets were dropped (idl/guard) or
  /// participants refused, each at most once a minute; the rest is reported at stop(). It runs in a
  /// thread of the service or of the caller of stop(). Set it before start().
  void set_packet_listener(PacketListener listener);
  /// Called for every request for a change, and for every refused request, in the thread that
  /// answers it. Set it before start().
  void set_call_listener(CallListener listener);
  /// Starts to answer, and publishes the models in force. Call it after Trainer::take_up(). Refuses
  /// an occupied port, an address that this host does not have, and a server or cell name that the
  /// wire does not allow.
  [[nodiscard]] Status start();
  /// Lets running requests finish, publishes that the server stops, and leaves DDS. May be started
  /// again.
  void stop();

  /// Before start() and after stop(), these do nothing.
  void publish_progress(const JobProgress& progress);
  /// Publishes the model that is in force for `cell` now.
  void publish_model(const std::string& cell);

  /// Sets the queue limits; the other options stay unchanged.
  void set_limits(const DdsOptions& options);
  /// Tells clients that the trainer serves more cells.
  void cells_added();
  /// Calls `work` with the calls of this process if the service runs and DdsOptions::local_calls is
  /// set; false: it does not. stop() ends the calls under way, and waits for `work`.
  [[nodiscard]] bool with_calls(const std::function<void(ServiceCalls&)>& work);
  /// The work done since start(); empty if the service does not run.
  [[nodiscard]] ServiceFigures figures();
  /// Reports whether its threads do their work. Waits for none of them.
  [[nodiscard]] Movement movement();

 private:
  class Running;
  /// Calls `work(running)` if the service runs. Holds no lock during the call: to publish a large
  /// model takes a while.
  template <typename Work>
  void while_running(const Work& work);

  const DdsOptions options_;
  PacketListener packet_listener_ = [](const char*, const std::string&) {};
  CallListener call_listener_;
  Trainer& trainer_;
  Store& store_;
  const ModelRegistry& registry_;
  Mutex mutex_;
  Condition published_;  // publishing_ has decreased
  std::unique_ptr<Running> running_ TRAMMEL_GUARDED_BY(mutex_);
  int publishing_ TRAMMEL_GUARDED_BY(mutex_) =
      0;  // threads in while_running(), each without the lock
};

}  // namespace trammel
