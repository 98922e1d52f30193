#pragma once

#include "server/diagnose/diagnose.h"

namespace trammel::test {

/// A diagnosis in seconds: few draws, no recovery, no next poses.
inline DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  return options;
}

}  // namespace trammel::test
