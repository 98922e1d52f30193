#pragma once

#include "server/base/result.h"

namespace CLI {
class App;
}

namespace trammel::cli {

class Action;

/// Adds all commands with their help to `app`; parsing puts the chosen action into `chosen`. Both
/// outlive the parsing.
void make_command_line(CLI::App& app, Action& chosen);

/// The program `trammel`: parses the command line, runs the command, writes errors to standard
/// error. Returns the exit code: 0, 2 wrong usage, 3 refused data, 4 unreachable or busy service.
[[nodiscard]] int run_command_line(int argc, const char* const* argv);

[[nodiscard]] int exit_code(ErrorCode code);

}  // namespace trammel::cli
