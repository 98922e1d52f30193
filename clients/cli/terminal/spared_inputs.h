#pragma once

#include <CLI/CLI.hpp>

#include "server/base/result.h"

namespace trammel::cli {

/// Refuses as wrong usage an output of the command that is one of the files it reads: `-o batch.csv` behind
/// `--batch batch.csv`. A model that is refitted (`train --from`) may be its own successor.
[[nodiscard]] Status check_inputs_are_spared(const CLI::App& command);

}  // namespace trammel::cli
