#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

/// The commands and options of the parser as plain text, the source of help, manual pages and shell
/// completions.
namespace trammel::cli {

struct OptionText {
  std::vector<std::string> names;  ///< `-o`, `--output`; for a positional argument its only name
  std::string value;               ///< `FILE`, `FLOAT`; empty: a flag
  std::string description;         ///< with range, default, and what it needs or excludes
  std::string group;               ///< its heading
  std::vector<std::string> words;  ///< the only values that it takes; empty: any
  std::string place;  ///< the name for a bare word in its place; empty: no bare word stands for it
  bool required = false, positional = false, repeated = false;

  /// `-o, --output FILE`; `CELL or --cell TEXT`.
  [[nodiscard]] std::string label() const;
};

struct CommandText {
  std::string name, description, footer;
  std::vector<OptionText> options;  ///< positional arguments first, groups together
  std::vector<CommandText> commands;

  /// `trammel plan [OPTIONS]`, as usage lines say it; `program` stands before the name.
  [[nodiscard]] std::string usage(const std::string& program) const;
};

[[nodiscard]] CommandText described(const CLI::App& app);

/// The number of columns that a text takes. Bytes that continue a character do not count.
[[nodiscard]] std::size_t columns_of(const std::string& text);

/// Lines of at most `width` columns, broken between words only; those after the first are indented
/// by `indent`. Line ends in `text` stay; a line that begins with a blank is an example and stays
/// whole.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t indent = 0,
                                  std::size_t width = 80);

/// Help in 80 columns for `app` and its commands.
void set_help_format(CLI::App& app);

}  // namespace trammel::cli
