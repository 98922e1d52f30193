#include "clients/cli/terminal/usage.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <set>

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
  for (const CLI::App* one : app.get_subcommands([](const CLI::App* c) { return !c->get_name().empty(); }))
    names.push_back(one->get_name());
  return names;
}

void add_option_names(const CLI::App& app, std::vector<std::string>& names) {
  for (const CLI::Option* option : app.get_options())
    names.insert(names.end(), option->get_lnames().begin(), option->get_lnames().end());
  for (const CLI::App* inner : app.get_subcommands([](const CLI::App* c) { return c->get_name().empty(); }))
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

Error unknown_command(const CLI::App& app, const std::string& word) {
  const std::string near = meant(word, command_names(app));
  return failure(ErrorCode::kUsage, "{}: no such command{}", shown_short(word), question("", near))
      .of("command")
      .with_text(shown_short(word))
      .next(near.empty() ? "trammel help lists them all" : fmt::format("trammel {} --help tells about it", near))
      .value();
}

Error unknown_option(const CLI::App& command, const std::string& word) {
  std::vector<std::string> names;
  add_option_names(command, names);
  const std::string name = word.substr(0, word.find('='));
  const std::string near = meant(name.substr(std::min(name.find_first_not_of('-'), name.size())), names);
  return failure(ErrorCode::kUsage, "{}: no such option{}", shown_short(name), question("--", near))
      .of(shown_short(name))
      .with_text(shown_short(word))
      .next(fmt::format("trammel {} --help lists them", command.get_name()))
      .value();
}

bool is_option(const std::string& word) {
  return word.size() > 1 && word[0] == '-' && !(word[1] >= '0' && word[1] <= '9') && word[1] != '.';
}

/// What kind of file each option takes, by its ending.
struct FileKind {
  const char* option;
  std::array<const char*, 4> endings;
  const char* what;
};
constexpr std::array kKinds = {
    FileKind{"--cell", {".yaml", ".yml"}, "a cell file (YAML)"},
    FileKind{"--robot", {".yaml", ".yml"}, "a robot file (YAML)"},
    FileKind{"--truth", {".yaml", ".yml"}, "the truth of a virtual robot (YAML)"},
    FileKind{"--model", {".model", ".json"}, "a model file, as trammel train writes it"},
    FileKind{"--batch", {".csv", ".txt", ".tsv", ".CSV"}, "measurements (CSV)"},
    FileKind{"--joints", {".csv", ".txt", ".tsv", ".CSV"}, "a table of joints (CSV)"},
    FileKind{"--plan", {".csv", ".txt", ".tsv", ".CSV"}, "a plan (CSV), as trammel plan writes it"},
};

bool takes(const FileKind& kind, const std::string& ending) {
  return std::any_of(kind.endings.begin(), kind.endings.end(),
                     [&](const char* one) { return one != nullptr && ending == one; });
}

/// The option that named the file; nothing where none did.
const CLI::Option* named_by(const CLI::App& command, const std::string& file) {
  for (const CLI::Option* option : command.get_options()) {
    const auto& said = option->results();
    if (std::find(said.begin(), said.end(), file) != said.end()) return option;
  }
  for (const CLI::App* inner : command.get_subcommands([](const CLI::App* c) { return c->get_name().empty(); })) {
    if (const CLI::Option* option = named_by(*inner, file)) return option;
  }
  return nullptr;
}

std::string like_it(const std::string& file) {
  std::error_code error;
  const fs::path folder = fs::path(file).has_parent_path() ? fs::path(file).parent_path() : fs::path(".");
  std::vector<std::string> names;
  for (fs::directory_iterator it(folder, error), end; !error && it != end && names.size() < 10'000; it.increment(error))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  const std::string near = near_miss(fs::path(file).filename().string(), names);
  if (near.empty()) return "";
  return fs::path(file).has_parent_path() ? (folder / near).string() : near;
}

std::string of_missing_file(const std::string& file, const CLI::App& command) {
  std::error_code error;
  if (const std::string near = like_it(file); !near.empty()) return fmt::format("did you mean {}?", shown(near));
  const CLI::Option* option = named_by(command, file);
  const bool may_be_cell = option != nullptr && option->check_name("--model") && !fs::path(file).has_extension() &&
                           command.get_option_no_throw("--service") != nullptr;
  if (may_be_cell) return fmt::format("to ask a daemon for the model of cell {}, add --service", shown(file));
  return fmt::format("paths count from the folder you are in, {}", fs::current_path(error).string());
}

std::string of_unwritable(const std::string& file) {
  std::error_code error;
  const fs::path folder = fs::path(file).parent_path();
  if (fs::is_directory(file, error)) return "name a file in it";
  if (!folder.empty() && !fs::exists(folder, error))
    return fmt::format("make the folder first: mkdir -p {}", shown(folder.string()));
  return "name a file that you may write, in a folder with room";
}

/// What stands at the top of the files that people mix up.
std::string kind_of_keys(const Error& error) {
  const auto has_key = [&](const char* key) { return error.field == key || error.field == std::string(key); };
  if (has_key("joints") || has_key("coupling")) return "a robot file";
  if (has_key("cells") || has_key("store")) return "a server file";
  if (has_key("robot") || has_key("tracker")) return "a cell file";
  if (has_key("noise")) return "the truth of a virtual robot";
  return "";
}

/// What the option takes that named this file, where its ending is that of another kind; else empty.
std::string of_wrong_kind(const std::string& file, const CLI::App& command) {
  std::error_code ignored;
  const CLI::Option* option = fs::is_regular_file(file, ignored) ? named_by(command, file) : nullptr;
  const std::string ending = fs::path(file).extension().string();
  const auto right =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const FileKind& kind) { return takes(kind, ending); });
  if (option == nullptr || right == kKinds.end()) return "";
  for (const FileKind& kind : kKinds) {
    if (option->check_name(kind.option) && !takes(kind, ending))
      return fmt::format("{} takes {}; a {} file goes to {}", kind.option, kind.what, ending, right->option);
  }
  return "";
}

std::string of_file(const Error& error, const CLI::App& command) {
  std::error_code ignored;
  if (fs::is_directory(error.file, ignored)) return "name a file in it";
  if (error.message.find("cannot be written") != std::string::npos) return of_unwritable(error.file);
  if (!fs::exists(error.file, ignored) && error.message.find("no such file") != std::string::npos)
    return of_missing_file(error.file, command);
  const CLI::Option* option = named_by(command, error.file);
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
      return "start one (trammeld --config SERVER.yaml) or name its --port; trammel doctor says what is in the way";
    case ErrorCode::kBusy:
      return "run the command again in a moment";
    case ErrorCode::kNotFound:
      return "trammel status lists what there is";
    default:
      return fmt::format("mend that and run the command again; trammel {} --help tells what it takes", command);
  }
}

}  // namespace

std::optional<Error> unknown_word(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty() || words[0] == "--help" || words[0] == "-h" || words[0] == "--version") return std::nullopt;
  const CLI::App* command = command_of(app, words[0]);
  if (command == nullptr && is_option(words[0])) {
    return failure(ErrorCode::kUsage, "{}: options stand behind a command", shown_short(words[0]))
        .of(shown_short(words[0]))
        .with_text(shown_short(words[0]))
        .next("trammel help lists the commands")
        .value();
  }
  if (command == nullptr) return unknown_command(app, words[0]);
  for (std::size_t k = 1; k < words.size() && words[k] != "--"; ++k) {
    if (!is_option(words[k])) continue;
    const bool is_long = words[k].starts_with("--");
    const std::string name = is_long ? words[k].substr(0, words[k].find('=')) : words[k].substr(0, 2);
    if (command->get_option_no_throw(name) == nullptr) return unknown_option(*command, words[k]);
  }
  return std::nullopt;
}

Error usage_error(const CLI::ParseError& error, const std::string& command) {
  std::string what = error.what();
  what = what.substr(0, what.find("\nRun with"));
  const std::string field = what.substr(0, what.find_first_of(": "));
  const std::string said = what.starts_with("Could not convert: ") ? what.substr(19) : "";
  const std::string option = !said.empty() ? said.substr(0, said.find(' ')) : field.starts_with('-') ? field : "";
  return failure(ErrorCode::kUsage, "{}", said.empty() ? what : said + ": not a number, or out of range")
      .of(option)
      .next(command.empty() ? "trammel help lists commands and topics"
                            : fmt::format("trammel {} --help tells its options, with examples", command))
      .value();
}

Error advised(Error error, const CLI::App& command) {
  for (Error& other : error.also) other = advised(std::move(other), command);
  std::set<std::string> kinds;
  for (const Error& one : apart(error)) {
    if (one.message.find("unknown key") != std::string::npos) kinds.insert(kind_of_keys(one));
  }
  kinds.erase("");
  const CLI::Option* option = error.file.empty() ? nullptr : named_by(command, error.file);
  if (kinds.size() == 1 && !error.also.empty() && option != nullptr) {  // a whole file of another kind
    const auto kind =
        std::find_if(kKinds.begin(), kKinds.end(), [&](const FileKind& one) { return option->check_name(one.option); });
    if (kind != kKinds.end()) {
      error.also.clear();
      error.next = fmt::format("this looks like {}; {} takes {}", *kinds.begin(), kind->option, kind->what);
    }
  }
  if (std::string other = error.file.empty() ? "" : of_wrong_kind(error.file, command); !other.empty())
    error.next = std::move(other);
  if (!error.next.empty()) return error;
  if (!error.file.empty()) error.next = of_file(error, command);
  if (error.next.empty()) error.next = of_kind(error, command.get_name());
  return error;
}

}  // namespace trammel::cli
