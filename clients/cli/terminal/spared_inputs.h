#pragma once

#include <CLI/CLI.hpp>

#include "server/base/result.h"

namespace trammel::cli {

/// Checks the outputs of the command before it does anything. Refuses as wrong usage an output that
/// is one of its input files (`-o batch.csv` behind `--batch batch.csv`), and two outputs in one
/// file or on standard output. Refuses as kRefused an output that cannot be written. A model that
/// is refitted (`train --from`) may be its own successor.
[[nodiscard]] Status check_outputs(const CLI::App& command);

}  // namespace trammel::cli
