#pragma once

#include "server/trainer/compute/frames.h"
#include "server/trainer/compute/task.h"

/// The messages between the service and its computing process. The service sends the texts of a
/// task, the task, its batches and `make`; then, as often as it likes, the texts of opponents and
/// `judge`. Each of these two is answered by `made`, `verdict` or `error`; before that come
/// `progress` and `found`.
namespace trammel::message {

/// The kind of a message: the member `is`.
[[nodiscard]] std::string kind_of(const Frame& frame);

/// The frames of a task, in order; all but its batches.
[[nodiscard]] std::vector<Frame> of_task(const ComputeTask& task);
[[nodiscard]] Frame of_batch(const BatchText& batch, bool judges);
[[nodiscard]] Frame make();
/// The frames of the question, in order.
[[nodiscard]] std::vector<Frame> of_opponents(const Opponents& opponents);

[[nodiscard]] Frame of_progress(const std::string& stage, double share);
[[nodiscard]] Frame of_findings(const std::string& findings, const std::string& page);
[[nodiscard]] Frame of_made(const Made& made);
[[nodiscard]] Frame of_verdict(const GateVerdict& verdict);
/// `over_memory`: it is not the data's fault.
[[nodiscard]] Frame of_error(const Error& error, bool over_memory);

// These functions throw nlohmann::json::exception if a message does not have its stated form.

/// The task of the texts `cell`, `robot` and `in_force` and the frame that ends them. Refuses a
/// cell that cannot be read.
struct TaskTexts {
  std::string cell, robot;
  std::optional<ModelText> in_force;
};
[[nodiscard]] Result<ComputeTask> to_task(const Frame& frame, TaskTexts texts);
[[nodiscard]] ModelText to_model_text(const Frame& frame);
[[nodiscard]] BatchText to_batch(const Frame& frame, bool& judges);
/// Reads the opponents of the question; its texts came before.
void read_opponents(const Frame& frame, Opponents& opponents);
struct Findings {
  std::string findings, page;
};
[[nodiscard]] Findings to_findings(const Frame& frame);
/// Refuses a model that does not load.
[[nodiscard]] Result<Made> to_made(const Frame& frame);
[[nodiscard]] GateVerdict to_verdict(const Frame& frame);
[[nodiscard]] Error to_error(const Frame& frame, bool& over_memory);

}  // namespace trammel::message
