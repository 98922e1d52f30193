#pragma once

#include <cstdint>

#include "server/store/store.h"
#include "server/trainer/compute/compute_options.h"

namespace trammel {

struct TrainerOptions {
  int queue_capacity = 16;        ///< jobs of one cell that were asked for and wait; one more is refused (kBusy)
  int max_poses = 5000;           ///< of one training, all its batches together; memory grows with the square
  double validation_share = 0.2;  ///< of the poses of a batch are held out to judge models by (judging_rows())
  double accept_ratio = 1.02;     ///< see GateOptions
  std::uint64_t seed = 1;
  bool trains = true;    ///< false: jobs wait for another server of the same store
  ServerSelf self = {};  ///< what is told of the process to the other servers of the store
  KeepRule keep = {};    ///< what of the store is pruned, after each job
  ComputeOptions compute = {};
};

}  // namespace trammel
