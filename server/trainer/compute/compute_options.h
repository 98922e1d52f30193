#pragma once

#include <functional>
#include <string>
#include <vector>

namespace trammel {

/// Receives the id of each batch whose text is read in this process: parsed, checked and split.
/// Called from several threads.
using BatchReads = std::function<void(const std::string& batch)>;

/// The place where jobs are computed, and their limits.
struct ComputeOptions {
  /// A program, with its arguments, that calls compute_main() with the arguments appended to them.
  /// Empty: jobs are computed in the trainer's own process, without limits, and their crash is a
  /// crash of the trainer.
  std::vector<std::string> program;
  int memory_mb = 0;   ///< MiB of one job; 0: half of the memory of this host or container
  int cpu_s = 14'400;  ///< s of processor time of one job
  BatchReads reads = {};
};

}  // namespace trammel
