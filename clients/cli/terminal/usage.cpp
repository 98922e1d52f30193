#include "clients/cli/terminal/usage.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "clients/cli/terminal/command_tree.h"
#include "clients/cli/terminal/help_topics.h"
#include "server/base/near_miss.h"
#include "server/base/plain_text.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

const CLI::App* command_of(const CLI::App& app, const std::string& name) {
  for (const CLI::App* one : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!name.empty() && one->get_name() == name) return one;
  }
  return nullptr;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* one :
       app.get_subcommands([](const CLI::App* c) { return !c->get_name().empty(); }))
    names.push_back(one->get_name());
  return names;
}

void add_option_names(const CLI::App& app, std::vector<std::string>& names) {
  for (const CLI::Option* option : app.get_options())
    names.insert(names.end(), option->get_lnames().begin(), option->get_lnames().end());
  for (const CLI::App* inner :
       app.get_subcommands([](const CLI::App* c) { return c->get_name().empty(); }))
    add_option_names(*inner, names);
}

/// The nearest of `known`: misspelled, or its only continuation.
std::string meant(const std::string& word, const std::vector<std::string>& known) {
  std::vector<std::string> longer;
  std::copy_if(known.begin(), known.end(), std::back_inserter(longer),
               [&](const std::string& one) { return word.size() > 1 && one.starts_with(word); });
  return longer.size() == 1 ? longer.front() : near_miss(word, known);
}

std::string question(const std::string& prefix, const std::string& meant) {
  return meant.empty() ? "" : ", did you mean " + prefix + meant + "?";
}

/// Words of other programs, and their equivalents here.
struct OtherWord {
  std::string_view word, here;
};
constexpr std::array kOtherCommands = {
    OtherWord{"abort", "trammel cancel JOB"},
    OtherWord{"apply", "trammel correct, or trammel activate CELL@VERSION"},
    OtherWord{"calibrate", "trammel train"},
    OtherWord{"compensate", "trammel correct"},
    OtherWord{"daemon", "trammeld --config server.yaml, a program of its own"},
    OtherWord{"delete", "trammel discard CELL BATCH"},
    OtherWord{"deploy", "trammel activate CELL@VERSION"},
    OtherWord{"diff", "trammel compare A B"},
    OtherWord{"fit", "trammel train"},
    OtherWord{"fix", "trammel correct"},
    OtherWord{"health", "trammel check"},
    OtherWord{"identify", "trammel train"},
    OtherWord{"info", "trammel show CELL@VERSION, or trammel status"},
    OtherWord{"init", "trammel setup FOLDER -o CELL, or a cell file (trammel help cell)"},
    OtherWord{"kill", "trammel cancel JOB"},
    OtherWord{"learn", "trammel train"},
    OtherWord{"list", "trammel status, or trammel models CELL"},
    OtherWord{"log", "trammel audit"},
    OtherWord{"login", "--security FOLDER, where a service asks for certificates"},
    OtherWord{"logs", "trammel audit"},
    OtherWord{"ls", "trammel status, or trammel models CELL"},
    OtherWord{"measure", "trammel plan (what to measure) or trammel convert (what was)"},
    OtherWord{"optimise", "trammel train"},
    OtherWord{"optimize", "trammel train"},
    OtherWord{"ping", "trammel status"},
    OtherWord{"publish", "trammel activate CELL@VERSION"},
    OtherWord{"push", "trammel submit CELL BATCH"},
    OtherWord{"remove", "trammel discard CELL BATCH"},
    OtherWord{"restore", "trammel rollback CELL"},
    OtherWord{"revert", "trammel rollback CELL"},
    OtherWord{"rm", "trammel discard CELL BATCH"},
    OtherWord{"run", "trammeld --config server.yaml, a program of its own"},
    OtherWord{"send", "trammel submit CELL BATCH"},
    OtherWord{"serve", "trammeld --config server.yaml, a program of its own"},
    OtherWord{"stop", "trammel cancel JOB"},
    OtherWord{"test", "trammel evaluate"},
    OtherWord{"undo", "trammel correct --undo, or trammel rollback CELL"},
    OtherWord{"upload", "trammel submit CELL BATCH"},
    OtherWord{"use", "trammel activate CELL@VERSION"},
    OtherWord{"validate", "trammel evaluate"},
    OtherWord{"verify", "trammel check"},
    OtherWord{"version", "trammel --version"}};
constexpr std::array kOtherOptions = {
    OtherWord{"address", "host"},   OtherWord{"config", "cell"},
    OtherWord{"csv", "batch"},      OtherWord{"data", "batch"},
    OtherWord{"dest", "output"},    OtherWord{"follow", "watch"},
    OtherWord{"input", "batch"},    OtherWord{"measurements", "batch"},
    OtherWord{"message", "reason"}, OtherWord{"n", "count"},
    OtherWord{"number", "count"},   OtherWord{"points", "count"},
    OtherWord{"poses", "count"},    OtherWord{"server", "host"},
    OtherWord{"url", "host"},       OtherWord{"wait", "watch"},
    OtherWord{"yes", "force"}};

std::string_view here(std::span<const OtherWord> words, std::string_view word) {
  const auto found = std::find_if(words.begin(), words.end(),
                                  [&](const OtherWord& one) { return one.word == word; });
  return found == words.end() ? std::string_view() : found->here;
}

/// `trammel help TOPIC`, where the word is a topic of the help; else empty.
std::string topic_called(const std::string& word) {
  for (const HelpTopic& topic : help_topics())
    if (topic.name == word) return "trammel help " + word;
  return "";
}

Error unknown_command(const CLI::App& app, const std::string& word) {
  const std::string topic = topic_called(word);
  const std::string_view other = topic.empty() ? here(kOtherCommands, word) : topic;
  if (!other.empty()) {
    return failure(ErrorCode::kUsage, "{}: no such command, did you mean {}?", word, other)
        .of("command")
        .with_text(word)
        .next("trammel help start shows the way from nothing to a corrected program")
        .value();
  }
  const std::string near = meant(word, command_names(app));
  return failure(ErrorCode::kUsage, "{}: no such command{}", shown_short(word), question("", near))
      .of("command")
      .with_text(shown_short(word))
      .next(near.empty() ? "trammel help all lists them"
                         : fmt::format("trammel {} --help tells about it", near))
      .value();
}

Error unknown_option(const CLI::App& command, const std::string& word) {
  std::vector<std::string> names;
  add_option_names(command, names);
  const std::string name = word.substr(0, word.find('='));
  const std::string bare = name.substr(std::min(name.find_first_not_of('-'), name.size()));
  const std::string other(here(kOtherOptions, bare));
  const bool is_here = std::find(names.begin(), names.end(), other) != names.end();
  const std::string near = is_here ? other : meant(bare, names);
  return failure(ErrorCode::kUsage, "{}: no such option{}", shown_short(name), question("--", near))
      .of(shown_short(name))
      .with_text(shown_short(word))
      .next(fmt::format("trammel {} --help lists them", command.get_name()))
      .value();
}

bool is_option(const std::string& word) {
  return word.size() > 1 && word[0] == '-' && !(word[1] >= '0' && word[1] <= '9') && word[1] != '.';
}

/// The kind of file that each option takes, by its ending, and the top-level keys that only this
/// kind has.
struct FileKind {
  const char* option;  ///< nullptr: none takes it
  std::array<const char*, 4> endings;
  const char* what;
  std::array<const char*, 2> keys = {};
};
constexpr std::array kKinds = {
    FileKind{"--cell", {".yaml", ".yml"}, "a cell file (YAML)", {"robot", "tracker"}},
    FileKind{"--robot", {".yaml", ".yml"}, "a robot file (YAML)", {"joints", "coupling"}},
    FileKind{"--truth", {".yaml", ".yml"}, "the truth of a virtual robot (YAML)", {"noise"}},
    FileKind{"--model", {".model", ".json"}, "a model file, as trammel train writes it"},
    FileKind{"--batch", {".csv", ".txt", ".tsv", ".CSV"}, "measurements (CSV)"},
    FileKind{"--joints", {".csv", ".txt", ".tsv", ".CSV"}, "a table of joints (CSV)"},
    FileKind{"--plan", {".csv", ".txt", ".tsv", ".CSV"}, "a plan (CSV), as trammel plan writes it"},
    FileKind{nullptr, {}, "a server file (YAML)", {"cells", "store"}},
};

/// The kind of file that the option takes. Null if the table does not list the option.
const FileKind* kind_taken_by(const CLI::Option& option) {
  const auto found = std::find_if(kKinds.begin(), kKinds.end(), [&](const FileKind& kind) {
    return kind.option != nullptr && option.check_name(kind.option);
  });
  return found == kKinds.end() ? nullptr : found;
}

/// The kind of file that has such a key at its top; null where it may be of several.
const FileKind* kind_with_key(const std::string& key) {
  const auto found = std::find_if(kKinds.begin(), kKinds.end(), [&](const FileKind& kind) {
    return std::any_of(kind.keys.begin(), kind.keys.end(),
                       [&](const char* one) { return one != nullptr && key == one; });
  });
  return found == kKinds.end() ? nullptr : found;
}

bool takes(const FileKind& kind, const std::string& ending) {
  return std::any_of(kind.endings.begin(), kind.endings.end(),
                     [&](const char* one) { return one != nullptr && ending == one; });
}

/// The option that named the file; null if none did.
const CLI::Option* named_by(const CLI::App& command, const std::string& file) {
  for (const CLI::Option* option : command.get_options()) {
    const auto& said = option->results();
    if (std::find(said.begin(), said.end(), file) != said.end()) return option;
  }
  for (const CLI::App* inner :
       command.get_subcommands([](const CLI::App* c) { return c->get_name().empty(); })) {
    if (const CLI::Option* option = named_by(*inner, file)) return option;
  }
  return nullptr;
}

std::string like_it(const std::string& file) {
  std::error_code error;
  const fs::path folder =
      fs::path(file).has_parent_path() ? fs::path(file).parent_path() : fs::path(".");
  std::vector<std::string> names;
  for (fs::directory_iterator it(folder, error), end; !error && it != end && names.size() < 10'000;
       it.increment(error))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  const std::string near = near_miss(fs::path(file).filename().string(), names);
  if (near.empty()) return "";
  return fs::path(file).has_parent_path() ? (folder / near).string() : near;
}

std::string of_missing_file(const std::string& file, const CLI::App& command) {
  std::error_code error;
  if (const std::string near = like_it(file); !near.empty())
    return fmt::format("did you mean {}?", shown(near));
  const CLI::Option* option = named_by(command, file);
  const bool may_be_cell = option != nullptr && option->check_name("--model") &&
                           !fs::path(file).has_extension() &&
                           command.get_option_no_throw("--service") != nullptr;
  if (may_be_cell)
    return fmt::format("to ask a daemon for the model of cell {}, add --service", shown(file));
  return fmt::format("paths count from the folder you are in, {}",
                     fs::current_path(error).string());
}

/// The kind of file that the option takes, if `file` has the ending of another kind; else empty.
std::string of_wrong_kind(const std::string& file, const CLI::Option& option) {
  std::error_code ignored;
  const std::string ending = fs::path(file).extension().string();
  const auto right = std::find_if(kKinds.begin(), kKinds.end(),
                                  [&](const FileKind& kind) { return takes(kind, ending); });
  const FileKind* taken = kind_taken_by(option);
  if (!fs::is_regular_file(file, ignored) || right == kKinds.end() || taken == nullptr ||
      takes(*taken, ending))
    return "";
  return fmt::format("{} takes {}; a {} file goes to {}", taken->option, taken->what, ending,
                     right->option);
}

/// The kind of file that the option takes, if all wrong keys belong to one other kind; else empty.
std::string of_other_keys(const Error& error, const CLI::Option& option) {
  const FileKind* taken = kind_taken_by(option);
  std::set<const FileKind*> kinds;
  for (const Error& one : apart(error)) kinds.insert(kind_with_key(one.field));
  kinds.erase(nullptr);
  kinds.erase(taken);  // its own keys may be wrong or missing
  if (taken == nullptr || error.also.empty() || kinds.size() != 1) return "";
  return fmt::format("this looks like {}; {} takes {}", (*kinds.begin())->what, taken->option,
                     taken->what);
}

std::string of_file(const Error& error, const CLI::App& command) {
  std::error_code ignored;
  if (fs::is_directory(error.file, ignored)) return "name a file in it";
  const CLI::Option* option = named_by(command, error.file);
  const bool is_of_all_of_it =
      error.code == ErrorCode::kRefused && !error.row && error.field.empty();
  if (option != nullptr && is_of_all_of_it && !fs::exists(error.file, ignored))
    return of_missing_file(error.file, command);
  const std::string ending = fs::path(error.file).extension().string();
  if (option != nullptr && option->check_name("--model"))
    return "train it anew, or fetch it again: the file is not whole";
  if (error.row) return fmt::format("mend row {} and run the command again", *error.row);
  if (ending == ".yaml" || ending == ".yml") return "trammel help cell tells what the file says";
  if (ending == ".csv") return "trammel help formats tells the columns";
  return "";
}

std::string of_kind(const Error& error, const std::string& command) {
  switch (error.code) {
    case ErrorCode::kUsage:
      return fmt::format("trammel {} --help tells its options, with examples", command);
    case ErrorCode::kUnreachable:
      return "start one (trammeld --config SERVER.yaml) or name its --port, and its --security "
             "where it asks for certificates; trammel doctor says what is in the way";
    case ErrorCode::kBusy:
      return "run the command again in a moment";
    case ErrorCode::kNotFound:
      return "trammel status lists what there is";
    default:
      return fmt::format(
          "mend that and run the command again; trammel {} --help tells what it takes", command);
  }
}

}  // namespace

std::optional<Error> unknown_word(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty() || words[0] == "--help" || words[0] == "-h" || words[0] == "--version")
    return std::nullopt;
  const CLI::App* command = command_of(app, words[0]);
  if (command == nullptr && is_option(words[0])) {
    return failure(ErrorCode::kUsage, "{}: options stand behind a command", shown_short(words[0]))
        .of(shown_short(words[0]))
        .with_text(shown_short(words[0]))
        .next("trammel help all lists the commands")
        .value();
  }
  if (command == nullptr) return unknown_command(app, words[0]);
  for (std::size_t k = 1; k < words.size() && words[k] != "--"; ++k) {
    if (!is_option(words[k])) {
      if (const CLI::App* inner = command_of(*command, words[k])) command = inner;  // `store init`
      continue;
    }
    const bool is_long = words[k].starts_with("--");
    const std::string name =
        is_long ? words[k].substr(0, words[k].find('=')) : words[k].substr(0, 2);
    if (command->get_option_no_throw(name) == nullptr) return unknown_option(*command, words[k]);
  }
  return std::nullopt;
}

namespace {

bool is_number(const std::string& word) {
  char* end = nullptr;
  std::strtod(word.c_str(), &end);
  return !word.empty() && end == word.c_str() + word.size();
}

/// The fault of a word where `option` takes a number; empty if it is one.
std::string no_number(const CLI::App& app, const std::string& command, const std::string& option,
                      const std::string& word) {
  const CLI::App* of = command_of(app, command);
  const CLI::Option* taken =
      of == nullptr || option.empty() ? nullptr : of->get_option_no_throw(option);
  const std::string type = taken == nullptr ? "" : taken->get_type_name();
  const bool is_whole = type.starts_with("INT") || type.starts_with("UINT");
  const bool has_digits_alone =
      !word.empty() && word.find_first_not_of("0123456789") == std::string::npos;
  if (is_whole && is_number(word) && !has_digits_alone && word[0] != '-')
    return fmt::format("{} is no whole number", shown_short(word));
  if (is_number(word)) return "";
  return fmt::format("{} is no {}number", shown_short(word), is_whole ? "whole " : "");
}

/// The word that the parser's sentence is about: `--count: Value abc not in range 1 to 9`,
/// `--domain = abc`.
std::string word_in(const std::string& what, bool unconverted) {
  const std::string before = ": Value ", behind = " not in range ";
  const std::size_t begin = what.find(before), end = what.rfind(behind);
  if (begin != std::string::npos && end != std::string::npos && end >= begin + before.size())
    return what.substr(begin + before.size(), end - begin - before.size());
  const std::size_t equals = unconverted ? what.find(" = ") : std::string::npos;
  return equals == std::string::npos ? "" : what.substr(equals + 3);
}

/// The syntax of the command if a required part is missing; else empty.
std::string form_of_command(const CLI::App& app, const CLI::ParseError& error,
                            const std::string& command) {
  const CLI::App* of = command_of(app, command);
  if (of == nullptr || dynamic_cast<const CLI::RequiredError*>(&error) == nullptr) return "";
  return "write " + described(*of).usage("trammel") + "; ";
}

}  // namespace

Error usage_error(const CLI::App& app, const CLI::ParseError& error, const std::string& command) {
  // Only the parser's sentence contains the option: `Could not convert: --seed = x`, `--cell is
  // required`.
  std::string what = error.what();
  const std::size_t behind = what.find(": ");
  const bool unconverted = dynamic_cast<const CLI::ConversionError*>(&error) != nullptr &&
                           behind != std::string::npos && !is_option(what);
  if (unconverted) what.erase(0, behind + 2);
  const std::string option = is_option(what) ? what.substr(0, what.find_first_of(": ")) : "";
  const std::string word = word_in(what, unconverted);
  const std::string none = word.empty() ? "" : no_number(app, command, option, word);
  if (!none.empty())
    what = option + ": " + none;
  else if (unconverted)
    what += ": not a number, or out of range";
  return failure(ErrorCode::kUsage, "{}", what)
      .of(option)
      .with_text(shown_short(word))
      .next(command.empty()
                ? "trammel help all lists commands and topics"
                : form_of_command(app, error, command) +
                      fmt::format("trammel {} --help tells its options, with examples", command))
      .value();
}

std::optional<Error> empty_word(const CLI::App& command) {
  for (const char* name :
       {"--cell", "--model", "--batch", "--robot", "--truth", "--plan", "--joints", "--output"}) {
    const CLI::Option* option = command.get_option_no_throw(name);
    const std::vector<std::string> said =
        option == nullptr ? std::vector<std::string>() : option->results();
    if (std::find(said.begin(), said.end(), "") == said.end()) continue;
    return failure(ErrorCode::kUsage, "{} is empty", name)
        .of(name)
        .next("it may come from a variable of a script that is not set")
        .value();
  }
  return std::nullopt;
}

Error advised(Error error, const CLI::App& command) {
  for (Error& other : error.also) other = advised(std::move(other), command);
  if (const CLI::Option* option = error.file.empty() ? nullptr : named_by(command, error.file);
      option != nullptr) {
    if (std::string other = of_other_keys(error, *option); !other.empty()) {
      error.also.clear();
      error.next = std::move(other);
    }
    if (std::string other = of_wrong_kind(error.file, *option); !other.empty())
      error.next = std::move(other);
  }
  if (!error.next.empty()) return error;
  if (!error.file.empty()) error.next = of_file(error, command);
  if (error.next.empty()) error.next = of_kind(error, command.get_name());
  return error;
}

}  // namespace trammel::cli
