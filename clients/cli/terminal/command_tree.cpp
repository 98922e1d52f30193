#include "clients/cli/terminal/command_tree.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>

#include "clients/cli/terminal/names.h"

namespace trammel::cli {

namespace {

constexpr std::size_t kNameColumn = 26;  // width of the column left of descriptions

/// `FLOAT:FLOAT in [0 - 0.9]` split into `FLOAT` and the text behind the colon.
struct TypeText {
  std::string name, range;
};

TypeText type_of(const CLI::Option& option) {
  if (option.get_type_size() == 0) return {};
  const std::string text = option.get_type_name();
  const std::size_t colon = std::min(text.find(':'), text.size());
  return {text.substr(0, colon), colon < text.size() ? text.substr(colon + 1) : ""};
}

std::vector<std::string> words_of(const std::string& range) {
  std::vector<std::string> words;
  if (!range.starts_with('{') || !range.ends_with('}')) return words;
  std::istringstream in(range.substr(1, range.size() - 2));
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

std::string range_text(const std::string& range) {
  const auto open = range.find('['), dash = range.find(" - "), close = range.find(']');
  if (open == std::string::npos || dash == std::string::npos || close == std::string::npos)
    return range;
  return range.substr(open + 1, dash - open - 1) + " to " +
         range.substr(dash + 3, close - dash - 3);
}

std::string related(const char* what, const std::set<CLI::Option*>& others) {
  std::string text;
  for (const CLI::Option* other : others) text += " --" + other->get_lnames().front();
  return text.empty() ? "" : fmt::format(". {}:{}", what, text);
}

OptionText described(const CLI::Option& option, const std::string& group) {
  OptionText text;
  text.positional = option.get_positional();
  text.required = option.get_required();
  text.repeated = option.get_expected_max() == CLI::detail::expected_max_vector_size;
  text.group = group;
  const TypeText type = type_of(option);
  text.words = words_of(type.range);
  text.value = type.name == "TEXT" && option.check_name("--output") ? "FILE" : type.name;
  if (text.positional) {
    text.names = {option.get_name(true)};
  } else {
    for (const std::string& name : option.get_snames()) text.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) text.names.push_back("--" + name);
  }
  text.description = option.get_description();
  std::vector<std::string> more;
  if (!text.words.empty()) {
    more.push_back(fmt::format("one of {}", fmt::join(text.words, ", ")));
  } else if (!type.range.empty()) {
    more.push_back(range_text(type.range));
  }
  if (!option.get_default_str().empty() && !type.name.empty()) {
    std::string usual = option.get_default_str();
    if (usual.starts_with('[') && usual.ends_with(']')) usual = usual.substr(1, usual.size() - 2);
    more.push_back("default " + usual);
  }
  if (text.required) more.emplace_back("required");
  if (!more.empty()) text.description += fmt::format(" ({})", fmt::join(more, "; "));
  text.description +=
      related("Needs", option.get_needs()) + related("Excludes", option.get_excludes());
  return text;
}

void add_options(const CLI::App& app, const std::string& heading,
                 std::vector<OptionText>& options) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;  // hidden
    options.push_back(described(*option, heading.empty() ? option->get_group() : heading));
  }
  for (const CLI::App* inner :
       app.get_subcommands([](const CLI::App* one) { return one->get_name().empty(); })) {
    const bool exactly_one =
        inner->get_require_option_min() == 1 && inner->get_require_option_max() == 1;
    add_options(*inner, inner->get_group() + (exactly_one ? " (exactly one)" : ""), options);
  }
}

std::string two_columns(const std::string& left, const std::string& right) {
  const std::string label = "  " + left;
  std::string text = label;
  if (label.size() + 1 >= kNameColumn) {
    text += "\n" + std::string(kNameColumn, ' ');
  } else {
    text += std::string(kNameColumn - label.size(), ' ');
  }
  const std::string filled = std::string(kNameColumn - 1, '.') + " " + right;
  return text + wrapped(filled, kNameColumn).substr(kNameColumn) + "\n";
}

std::string help_of(const CommandText& command, const std::string& program) {
  std::string text =
      wrapped(command.description) + "\n" + wrapped("Usage: " + command.usage(program), 2) + "\n";
  std::vector<std::string> groups;
  for (const OptionText& option : command.options) {
    const std::string group = option.positional ? "Arguments" : option.group;
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  for (const std::string& group : groups) {
    text += "\n" + group + ":\n";
    for (const OptionText& option : command.options) {
      if ((option.positional ? "Arguments" : option.group) == group)
        text += two_columns(option.label(), option.description);
    }
  }
  if (!command.commands.empty()) text += "\nSubcommands:\n";
  for (const CommandText& one : command.commands) text += two_columns(one.name, one.description);
  if (!command.footer.empty()) text += "\n" + wrapped(command.footer) + "\n";
  return text;
}

/// The parser's formatter for all of our help.
class HelpFormat : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode) const override {
    const std::size_t blank = name.rfind(' ');
    const bool of_command = app->get_parent() != nullptr;
    const std::string program =
        of_command ? (blank == std::string::npos ? "trammel" : name.substr(0, blank)) : "";
    return help_of(trammel::cli::described(*app), program);
  }
};

std::string wrapped_line(const std::string& line, std::size_t indent, std::size_t width) {
  std::istringstream in(line);
  std::string text, row;
  for (std::string word; in >> word;) {
    if (!row.empty() && columns_of(row) + 1 + columns_of(word) > width) {
      text += row + "\n";
      row = std::string(indent, ' ') + word;
    } else {
      row += row.empty() ? word : " " + word;
    }
  }
  return text + row;
}

}  // namespace

std::string OptionText::label() const {
  if (positional) return names.front() + (repeated ? " ..." : "");
  return fmt::format("{}{}{}{}", place.empty() ? "" : place + " or ", fmt::join(names, ", "),
                     value.empty() ? "" : " " + value, repeated ? " ..." : "");
}

std::string CommandText::usage(const std::string& program) const {
  std::string text = program.empty() ? name : program + " " + name;
  bool any = false;
  const auto add_word = [&](const std::string& word, const OptionText& option) {
    text += " " + (option.required ? word : "[" + word + "]") + (option.repeated ? "..." : "");
  };
  for (const OptionText& option : options)
    if (!option.place.empty()) add_word(option.place, option);
  for (const OptionText& option : options)
    if (option.positional) add_word(option.names.front(), option);
  for (const OptionText& option : options) {
    const bool is_said_by_option = option.place.empty() && !option.positional;
    if (is_said_by_option && option.required)
      text += fmt::format(" {} {}", option.names.back(), option.value);
    any |= !option.required;
  }
  if (any) text += " [OPTIONS]";
  return text + (commands.empty() ? "" : " [SUBCOMMAND]");
}

CommandText described(const CLI::App& app) {
  CommandText text{app.get_name(), app.get_description(), app.get_footer(), {}, {}};
  add_options(app, "", text.options);
  const auto places = places_of_words(app.get_name());
  for (auto place = places.rbegin(); place != places.rend(); ++place) {
    const auto at =
        std::find_if(text.options.begin(), text.options.end(), [&](const OptionText& one) {
          return std::find(one.names.begin(), one.names.end(), place->option) != one.names.end();
        });
    if (at == text.options.end()) continue;
    at->place = place->word;
    at->group = "Arguments";
    std::rotate(text.options.begin(), at, at + 1);
  }
  std::stable_partition(text.options.begin(), text.options.end(),
                        [](const OptionText& one) { return one.positional || !one.place.empty(); });
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* one) { return !one->get_name().empty(); })) {
    if (!command->get_group().empty()) text.commands.push_back(described(*command));
  }
  return text;
}

std::size_t columns_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string wrapped(const std::string& text, std::size_t indent, std::size_t width) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);)
    lines.push_back(line.starts_with(' ') ? line : wrapped_line(line, indent, width));
  return fmt::format("{}", fmt::join(lines, "\n"));
}

void set_help_format(CLI::App& app) {
  const auto format = std::make_shared<HelpFormat>();
  app.formatter(format);
  for (CLI::App* command : app.get_subcommands({})) command->formatter(format);
}

}  // namespace trammel::cli
