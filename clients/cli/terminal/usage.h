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

/// A command or an option among `words` (without the program's name) that does not exist, with a
/// similar one that exists; empty if all exist. Found before anything is parsed.
[[nodiscard]] std::optional<Error> unknown_word(const CLI::App& app,
                                                const std::vector<std::string>& words);

/// An option for a file or a cell with an empty word; empty if there is none.
[[nodiscard]] std::optional<Error> empty_word(const CLI::App& command);

/// The error of the parser: field is the option, `next` where to read about it.
[[nodiscard]] Error usage_error(const CLI::App& app, const CLI::ParseError& error,
                                const std::string& command);

/// The error with a next step, unless it has one: by the fault in its file, and by the option of
/// `command` that named the file. Errors in `also` get theirs as well.
[[nodiscard]] Error advised(Error error, const CLI::App& command);

}  // namespace trammel::cli
