#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "server/trainer/compute/child_process.h"
#include "server/trainer/compute/compute_options.h"
#include "server/trainer/compute/frames.h"
#include "server/trainer/compute/task.h"

namespace trammel {

/// The signals by which a job learns that it must end.
struct StopRequests {
  std::stop_token service;  ///< the service stops: the job goes on after the next start
  std::stop_token job;      ///< the job is cancelled
  [[nodiscard]] bool any() const { return service.stop_requested() || job.stop_requested(); }
};

/// Computes a job in a process of its own, so that it cannot harm others. The process is ended at
/// once on a stop, within two seconds when it crashes or stands still, and when it exceeds the
/// limits of a job. It stands still when it neither progresses nor wants to: it used no processor
/// time for a second, and is neither ready to run nor waiting for the disk. An endless computation
/// is ended by the limit of processor time.
class ComputeProcess : public Computing {
 public:
  /// Refuses (kInternal) where no process can be started.
  [[nodiscard]] static Result<std::unique_ptr<ComputeProcess>> start(const ComputeOptions& options,
                                                                     const ComputeTask& task,
                                                                     const StopRequests& stop);
  ~ComputeProcess() override;

  [[nodiscard]] Status take(const BatchText& batch, bool judges) override;
  [[nodiscard]] Result<Made> make(const ComputeWatch& watch) override;
  [[nodiscard]] Result<GateVerdict> judge(const Opponents& opponents) override;
  [[nodiscard]] std::optional<Breakdown> breakdown() const override { return breakdown_; }
  [[nodiscard]] ComputeCost cost() const override;

 private:
  class Wake;
  ComputeProcess(const ComputeOptions& options, std::unique_ptr<ChildProcess> child,
                 const StopRequests& stop);

  [[nodiscard]] Status send(const Frame& frame);
  /// The next message that is an answer; earlier messages go to `watch`.
  [[nodiscard]] Result<Frame> answer(const ComputeWatch& watch);
  /// Handles a message on the way.
  [[nodiscard]] Status heard(const Frame& frame, const ComputeWatch& watch);
  /// Waits until the channel is ready for `events` and looks after the process meanwhile.
  [[nodiscard]] Status wait(short events);
  /// Asked every tick.
  [[nodiscard]] Status look_after();
  void read_words();
  [[nodiscard]] Status receive();
  /// Ends the process for this reason.
  [[nodiscard]] Failure broken(Breakdown::Kind kind, Failure why);
  [[nodiscard]] Failure crashed();

  const ComputeOptions options_;
  const std::unique_ptr<ChildProcess> child_;
  const std::unique_ptr<Wake> wake_;
  FrameReader reader_;
  std::string words_;  // the last ones it wrote
  std::optional<Breakdown> breakdown_;
  std::chrono::steady_clock::time_point next_tick_;
  int ticks_still_ = 0;
  double time_at_last_tick_ = 0;  // s, of the processor
};

/// Starts to compute: in this process if `options` names no program, otherwise in a process of its
/// own.
[[nodiscard]] Result<std::unique_ptr<Computing>> start_computing(const ComputeOptions& options,
                                                                 ComputeTask task,
                                                                 const StopRequests& stop);

}  // namespace trammel
