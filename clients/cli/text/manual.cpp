#include "clients/cli/text/manual.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "clients/cli/terminal/help_topics.h"
#include "server/base/letters.h"

namespace trammel::cli {

namespace {

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

/// Escapes text for troff: no line becomes a request, and the hyphens are those of options.
std::string troff(const std::string& text) {
  std::string safe = replaced(replaced(text, "\\", "\\e"), "-", "\\-");
  if (safe.starts_with('.') || safe.starts_with('\'')) safe = "\\&" + safe;
  return replaced(replaced(safe, "\n.", "\n\\&."), "\n'", "\n\\&'");
}

std::string example_block(const std::string& lines) { return ".nf\n" + troff(lines) + "\n.fi\n"; }

/// Paragraphs, and examples where lines begin with a blank.
std::string paragraphs(const std::string& text) {
  std::istringstream in(text);
  std::string page;
  for (std::string line; std::getline(in, line);) {
    const bool example = line.starts_with(' ');
    page += line.empty() ? ".PP\n" : example ? example_block(line) : troff(line) + "\n";
  }
  return page;
}

std::string options_text(const CommandText& command) {
  std::string page, group;
  for (const OptionText& option : command.options) {
    const std::string heading = option.positional ? "Arguments" : option.group;
    if (heading != group) page += fmt::format(".SS {}\n", troff(heading));
    group = heading;
    page += fmt::format(".TP\n.B {}\n{}\n", troff(option.label()), troff(option.description));
  }
  return page.empty() ? "" : ".SH OPTIONS\n" + page;
}

std::string head(const std::string& name, const std::string& version,
                 const std::string& description, const std::string& usage) {
  return fmt::format(
      ".TH {} 1 \"\" \"trammel {}\" \"Trammel\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n.B {}\n",
      troff(upper(name)), version, troff(name), troff(description), troff(usage));
}

constexpr const char* kEnd =
    ".SH EXIT STATUS\n0 done; 1 done but not all; 2 wrong usage; 3 refused data; 4 service "
    "unreachable or busy.\n"
    ".SH ENVIRONMENT\n.TP\n.B TRAMMEL_DEFAULTS\nFile of options that every command takes, name = "
    "value, one a line.\n"
    ".TP\n.B NO_COLOR\nNo colours on a terminal, where it is set.\n";

std::string page_of(const CommandText& command, const std::string& version) {
  std::string page =
      head("trammel-" + command.name, version, command.description, command.usage("trammel")) +
      options_text(command);
  if (const auto examples = examples_of(command.name); !examples.empty())
    page += ".SH EXAMPLES\n" + example_block(std::string(examples));
  return page + kEnd + ".SH SEE ALSO\n.BR trammel (1)\n";
}

std::string page_of_program(const CommandText& program, const std::string& version) {
  std::string page =
      head("trammel", version, program.description, program.usage("")) + options_text(program);
  page += ".SH COMMANDS\n";
  for (const CommandText& command : program.commands)
    page += fmt::format(".TP\n.BR trammel\\-{} (1)\n{}\n", troff(command.name),
                        troff(command.description));
  for (const HelpTopic& topic : help_topics()) {
    page += fmt::format(".SH {}\n{}", troff(upper(topic.name)), paragraphs(topic.text));
  }
  return page + kEnd;
}

std::string option_names(const CommandText& command) {
  std::vector<std::string> names;
  for (const OptionText& option : command.options) {
    if (!option.positional) names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return fmt::format("{}", fmt::join(names, " "));
}

std::string topic_names() {
  std::string names;
  for (const HelpTopic& topic : help_topics()) names += fmt::format(" {}", topic.name);
  return names;
}

/// The words that may follow the command itself.
std::string positional_words(const CommandText& command, const std::string& commands) {
  if (command.name == "help") return commands + topic_names();
  for (const OptionText& option : command.options) {
    if (option.positional && !option.words.empty())
      return fmt::format("{}", fmt::join(option.words, " "));
  }
  return "";
}

std::string command_names(const CommandText& program) {
  std::string names;
  for (const CommandText& command : program.commands)
    names += (names.empty() ? "" : " ") + command.name;
  return names;
}

/// For single quotes of a shell.
std::string quoted(const std::string& text) { return replaced(text, "'", "'\\''"); }

}  // namespace

std::vector<TextFile> manual_pages(const CommandText& program, const std::string& version,
                                   const std::string& folder) {
  std::vector<TextFile> pages = {{folder + "/trammel.1", page_of_program(program, version)}};
  for (const CommandText& command : program.commands)
    pages.push_back(
        {fmt::format("{}/trammel-{}.1", folder, command.name), page_of(command, version)});
  return pages;
}

std::string bash_completion(const CommandText& program) {
  std::string cases;
  for (const CommandText& command : program.commands) {
    std::string values;
    for (const OptionText& option : command.options) {
      if (option.words.empty() || option.positional) continue;
      values += fmt::format("        {}) words='{}' ;;\n", fmt::join(option.names, "|"),
                            fmt::join(option.words, " "));
    }
    if (!values.empty()) values = "      case \"$previous\" in\n" + values + "      esac\n";
    cases += fmt::format("    {})\n      options='{}'\n      arguments='{}'\n{}      ;;\n",
                         command.name, option_names(command),
                         positional_words(command, command_names(program)), values);
  }
  return fmt::format(
      "# bash completion of trammel; made by: trammel completion bash\n"
      "_trammel() {{\n"
      "  local current=\"${{COMP_WORDS[COMP_CWORD]}}\" previous=\"${{COMP_WORDS[COMP_CWORD-1]}}\"\n"
      "  local options='--help --version' arguments='' words=''\n"
      "  COMPREPLY=()\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
      "    COMPREPLY=($(compgen -W '{} --help --version' -- \"$current\"))\n"
      "    return\n"
      "  fi\n"
      "  case \"${{COMP_WORDS[1]}}\" in\n{}  esac\n"
      "  if [ -n \"$words\" ]; then\n"
      "    COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
      "  elif [[ \"$current\" == -* ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n"
      "  elif [[ \"$previous\" != -* ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$arguments\" -- \"$current\"))\n"
      "  fi\n"
      "}}\n"
      "complete -o default -F _trammel trammel\n",
      command_names(program), cases);
}

std::string zsh_completion(const CommandText& program) {
  const auto described_as = [](const std::string& text) {
    return quoted(replaced(replaced(replaced(text, "[", "\\["), "]", "\\]"), ":", "\\:"));
  };
  std::string commands, cases;
  for (const CommandText& command : program.commands) {
    commands += fmt::format("    '{}:{}'\n", command.name, described_as(command.description));
    std::string arguments;
    for (const OptionText& option : command.options) {
      const std::string action =
          option.words.empty() ? "_files" : fmt::format("({})", fmt::join(option.words, " "));
      if (option.positional) continue;
      for (const std::string& name : option.names) {
        arguments +=
            fmt::format(" \\\n        '{}{}[{}]{}'", option.repeated ? "*" : "", name,
                        described_as(option.description),
                        option.value.empty() ? "" : fmt::format(":{}:{}", option.value, action));
      }
    }
    const std::string words = positional_words(command, command_names(program));
    cases += fmt::format("    {})\n      _arguments{} \\\n        '*:argument:{}' ;;\n",
                         command.name, arguments, words.empty() ? "_files" : "(" + words + ")");
  }
  return fmt::format(
      "#compdef trammel\n"
      "# zsh completion of trammel; made by: trammel completion zsh\n"
      "_trammel() {{\n"
      "  local -a commands\n"
      "  commands=(\n{}  )\n"
      "  if (( CURRENT == 2 )); then\n"
      "    _describe command commands\n"
      "    return\n"
      "  fi\n"
      "  shift words\n"
      "  (( CURRENT-- ))\n"
      "  case $words[1] in\n{}  esac\n"
      "}}\n"
      "_trammel \"$@\"\n",
      commands, cases);
}

std::string fish_completion(const CommandText& program) {
  std::string lines = "# fish completion of trammel; made by: trammel completion fish\n";
  for (const CommandText& command : program.commands) {
    lines += fmt::format("complete -c trammel -n __fish_use_subcommand -f -a {} -d '{}'\n",
                         command.name, quoted(command.description));
    const std::string here =
        fmt::format("complete -c trammel -n '__fish_seen_subcommand_from {}'", command.name);
    for (const OptionText& option : command.options) {
      if (option.positional) continue;
      std::string names;
      for (const std::string& name : option.names)
        names += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      const std::string value = option.value.empty() ? ""
                                : option.words.empty()
                                    ? " -r"
                                    : fmt::format(" -x -a '{}'", fmt::join(option.words, " "));
      lines += fmt::format("{}{}{} -d '{}'\n", here, names, value, quoted(option.description));
    }
    const std::string words = positional_words(command, command_names(program));
    if (!words.empty()) lines += fmt::format("{} -f -a '{}'\n", here, words);
  }
  return lines;
}

}  // namespace trammel::cli
