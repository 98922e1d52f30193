#pragma once

#include <functional>
#include <string>
#include <vector>

namespace trammel {

/// Hears the id of each batch whose text is read in this process: parsed, checked and split. From
/// several threads.
using BatchReads = std::function<void(const std::string& batch)>;

/// Where jobs are computed, and what one may take.
struct ComputeOptions {
  /// A program, with its arguments, that calls compute_main() with those that are added to them.
  /// Empty: in the process of the trainer, where nothing can be limited, and where a crash is its
  /// own.
  std::vector<std::string> program;
  int memory_mb = 0;   ///< MiB of one job; 0: half of what this host or container has
  int cpu_s = 14'400;  ///< s of processor time of one job
  BatchReads reads = {};
};

}  // namespace trammel
