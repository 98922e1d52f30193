#pragma once

#include <string>
#include <vector>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "server/base/result.h"

namespace trammel::cli {

/// The arguments of `predict` where the input is a program.
struct PredictProgramArguments {
  std::vector<std::string> inputs;
  std::string model, tool, payload, format, output, json, frames;
  ServiceOptions service;
  std::vector<std::string> idle_axes = {};
  std::string task = {};                    ///< of an ABB backup
  std::vector<double> pulses_per_deg = {};  ///< of a Yaskawa job
};

/// A target without a prediction makes it Extent::kPart.
[[nodiscard]] Result<Extent> predict_program(const PredictProgramArguments& arguments);

}  // namespace trammel::cli
