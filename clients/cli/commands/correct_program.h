#pragma once

#include <string>
#include <vector>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "server/base/result.h"

namespace trammel::cli {

/// The arguments of `correct` where the input is a program.
struct CorrectProgramArguments {
  std::vector<std::string> inputs;
  std::string model, tool, payload, format, output, receipt, report, json, frames;
  bool allow_failed = false, strict = false, keep_digits = false, undo = false, again = false,
       split = false, keep_joints = false;
  double tolerance_mm = 0;  ///< 0: none
  ServiceOptions service;
  std::vector<std::string> idle_axes = {};
  std::string task = {};                    ///< of an ABB backup
  std::vector<double> pulses_per_deg = {};  ///< of a Yaskawa job
  bool lead_in = false;
  std::string free_turn = {};  ///< `rz`; empty: none
};

[[nodiscard]] Result<Extent> correct_program(const CorrectProgramArguments& arguments);

}  // namespace trammel::cli
