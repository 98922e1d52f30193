#pragma once

#include <cstdint>

namespace trammel {

struct TrainerOptions {
  int queue_capacity = 16;        ///< jobs waiting; one more is refused (kBusy) and nothing is stored
  int max_poses = 5000;           ///< of one training, all its batches together; memory grows with the square
  double validation_share = 0.2;  ///< of the poses of a batch are held out to judge models by (judging_rows())
  double accept_ratio = 1.02;     ///< see GateOptions
  std::uint64_t seed = 1;
};

}  // namespace trammel
