#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"

namespace CLI {
class App;
}

/// Options that people would give with every command, from one file.
namespace trammel::cli {

/// The file that TRAMMEL_DEFAULTS names, else `trammel/defaults` in XDG_CONFIG_HOME or ~/.config;
/// empty where there is none.
[[nodiscard]] std::string defaults_path();

/// `words` (without the program's name) by option, followed by the options of the defaults file. An
/// option is added if the command has it and `words` does not contain it. Refuses (kUsage) a file
/// that cannot be read, a line that is no `name = value`, and a name that is none of host,
/// discovery-server, port, security, domain, timeout, cell, tool, payload, seed.
[[nodiscard]] Result<std::vector<std::string>> with_defaults(const CLI::App& app,
                                                             std::vector<std::string> words,
                                                             const std::string& path);

}  // namespace trammel::cli
