#pragma once

#include <string>
#include <vector>

namespace trammel {

/// Where jobs are computed, and what one may take.
struct ComputeOptions {
  /// A program, with its arguments, that calls compute_main() with those that are added to them.
  /// Empty: in the process of the trainer, where nothing can be limited, and where a crash is its
  /// own.
  std::vector<std::string> program;
  int memory_mb = 0;   ///< MiB of one job; 0: half of what this host or container has
  int cpu_s = 14'400;  ///< s of processor time of one job
};

}  // namespace trammel
