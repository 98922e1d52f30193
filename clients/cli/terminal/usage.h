#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

/// The faults of a command line, as data with a next step.
namespace trammel::cli {

/// A command or an option among `words` (without the program's name) that does not exist, with the
/// one that was meant; nothing where all exist. Found before anything is parsed.
[[nodiscard]] std::optional<Error> unknown_word(const CLI::App& app,
                                                const std::vector<std::string>& words);

/// An option that names a file or a cell and was given an empty word; nothing where none was.
[[nodiscard]] std::optional<Error> empty_word(const CLI::App& command);

/// The error of the parser: field is the option, `next` where to read about it.
[[nodiscard]] Error usage_error(const CLI::App& app, const CLI::ParseError& error,
                                const std::string& command);

/// The error with what to do next, where nobody on the way here knew it: by what is wrong with its
/// file, and by which option of `command` named that file. Errors in `also` likewise.
[[nodiscard]] Error advised(Error error, const CLI::App& command);

}  // namespace trammel::cli
