#pragma once

#include <cstdint>

#include "server/store/store.h"
#include "server/tasks/accept/gate.h"
#include "server/trainer/compute/compute_options.h"

namespace trammel {

struct TrainerOptions {
  int queue_capacity =
      16;  ///< jobs of one cell that were asked for and wait; one more is refused (kBusy)
  int max_poses = 5000;  ///< of one training, with all its batches; memory grows with the square
  double validation_share =
      kUsualJudgingShare;  ///< of the poses of a batch are held out to judge models by
  double accept_ratio = GateOptions::kUsualAcceptRatio;
  std::uint64_t seed = 1;
  bool trains = true;    ///< false: jobs wait for another server of the same store
  ServerSelf self = {};  ///< the description of this process for the other servers of the store
  KeepRule keep = {};    ///< the rule for pruning the store, after each job
  ComputeOptions compute = {};
};

}  // namespace trammel
