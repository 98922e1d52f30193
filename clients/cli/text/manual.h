#pragma once

#include <string>
#include <vector>

#include "clients/cli/terminal/command_tree.h"
#include "server/base/text_file.h"

/// Manual pages and shell completions of the commands, from the same tree as their help.
namespace trammel::cli {

/// One page in troff for the program, `trammel.1`, and one for each command, `trammel-plan.1`, into
/// `folder`.
[[nodiscard]] std::vector<TextFile> manual_pages(const CommandText& program,
                                                 const std::string& version,
                                                 const std::string& folder);

[[nodiscard]] std::string bash_completion(const CommandText& program);
[[nodiscard]] std::string zsh_completion(const CommandText& program);
[[nodiscard]] std::string fish_completion(const CommandText& program);

}  // namespace trammel::cli
