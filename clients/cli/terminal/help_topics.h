#pragma once

#include <span>
#include <string>
#include <string_view>

/// The texts of `trammel help TOPIC` and of the ends of `--help`.
namespace trammel::cli {

struct HelpTopic {
  const char* name;
  const char* title;  ///< one clause, for the list of topics
  const char*
      text;  ///< without line breaks inside paragraphs; lines that begin with a blank are examples
};

[[nodiscard]] std::span<const HelpTopic> help_topics();

/// The ten everyday commands in groups, for a user who types `trammel` alone.
[[nodiscard]] std::string_view overview();

/// Command lines that work, one a line, for the end of a command's help; empty for a command that
/// is not known.
[[nodiscard]] std::string_view examples_of(std::string_view command);

/// Units, outputs and exit codes: the end of every help.
[[nodiscard]] std::string_view common_footer();

}  // namespace trammel::cli
