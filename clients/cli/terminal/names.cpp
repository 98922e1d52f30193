#include "clients/cli/terminal/names.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <set>

#include "server/robot/cell.h"

namespace trammel::cli {

namespace {

const Place kCell = {"--cell", "CELL"}, kModel = {"--model", "MODEL"},
            kVersion = {"--model", "CELL@VERSION"}, kBatch = {"--batch", "BATCH"},
            kJob = {"--job", "JOB"};

/// The options for bare words in each command. Remaining bare words are the command's own
/// arguments.
const std::map<std::string, std::vector<Place>> kPlaces = {{"activate", {kVersion}},
                                                           {"audit", {kCell}},
                                                           {"batches", {kCell, kBatch}},
                                                           {"cancel", {kJob}},
                                                           {"check", {kModel, kBatch}},
                                                           {"confirm-robot", {kCell}},
                                                           {"correct", {kModel}},
                                                           {"diagnose", {kCell, kBatch}},
                                                           {"discard", {kCell, kBatch}},
                                                           {"evaluate", {kModel, kBatch}},
                                                           {"export", {kVersion}},
                                                           {"export-robot", {kModel}},
                                                           {"history", {kCell}},
                                                           {"import", {kCell, kModel}},
                                                           {"jobs", {kCell}},
                                                           {"models", {kCell}},
                                                           {"plan", {kCell}},
                                                           {"predict", {kModel}},
                                                           {"release", {kCell, kBatch}},
                                                           {"remedies", {kModel}},
                                                           {"replay", {kModel}},
                                                           {"report", {kModel, kBatch}},
                                                           {"retrain", {kCell, kBatch}},
                                                           {"rollback", {kCell}},
                                                           {"show", {kVersion}},
                                                           {"simulate", {kCell}},
                                                           {"submit", {kCell, kBatch}},
                                                           {"train", {kCell, kBatch}},
                                                           {"view", {kCell}},
                                                           {"watch", {kJob}}};

bool is_bare(const std::string& word) {
  return word.size() < 2 || word[0] != '-' || (word[1] >= '0' && word[1] <= '9') || word[1] == '.';
}

/// The parts of a command line.
struct Taken {
  std::set<const CLI::Option*> said;
  std::vector<std::size_t> bare;  ///< their places
};

Taken taken_apart(const CLI::App& command, const std::vector<std::string>& words) {
  Taken taken;
  const auto end =
      static_cast<std::size_t>(std::find(words.begin(), words.end(), "--") - words.begin());
  for (std::size_t k = 1; k < end; ++k) {
    if (is_bare(words[k])) {
      taken.bare.push_back(k);
      continue;
    }
    const bool is_long = words[k].starts_with("--");
    const std::size_t equals = is_long ? words[k].find('=') : std::string::npos;
    const CLI::Option* option =
        command.get_option_no_throw(is_long ? words[k].substr(0, equals) : words[k].substr(0, 2));
    if (option == nullptr) continue;
    taken.said.insert(option);
    const bool has_value = equals != std::string::npos || (!is_long && words[k].size() > 2);
    if (has_value || option->get_items_expected_max() == 0) continue;
    ++k;  // its value
    while (option->get_allow_extra_args() && k + 1 < end && is_bare(words[k + 1])) ++k;
  }
  return taken;
}

bool may_repeat(const CLI::Option& option) {
  return option.get_expected_max() == CLI::detail::expected_max_vector_size;
}

/// The number of bare words that the parser needs for the command's own arguments.
std::size_t own_words(const CLI::App& command) {
  std::size_t count = 0;
  for (const CLI::Option* option : command.get_options())
    if (option->get_positional() && option->get_required()) ++count;
  return count;
}

/// The options for which bare words may stand, in their order. The last one may take several words.
std::vector<const CLI::Option*> free_places(const CLI::App& command, const Taken& taken,
                                            bool cell_is_known) {
  std::vector<const CLI::Option*> free;
  std::size_t required = 0;
  for (const Place& place : places_of_words(command.get_name())) {
    const CLI::Option* option = command.get_option_no_throw(place.option);
    if (option == nullptr || taken.said.contains(option)) continue;
    free.push_back(option);
    required += option->get_required() ? 1 : 0;
  }
  const bool skips_cell = cell_is_known && !free.empty() && free.front()->check_name("--cell") &&
                          free.front()->get_required() && taken.bare.size() < required;
  if (skips_cell) free.erase(free.begin());
  return free;
}

/// True if all bare words are the command's own arguments: `correct --undo` needs no model.
bool needs_no_name(const CLI::App& command, const Taken& taken) {
  const CLI::Option* undo = command.get_option_no_throw("--undo");
  return (undo != nullptr && taken.said.contains(undo)) || taken.bare.size() <= own_words(command);
}

const CLI::App* command_of_words(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty() || words[0].empty()) return nullptr;
  const auto found =
      app.get_subcommands([&](const CLI::App* one) { return one->get_name() == words[0]; });
  return found.empty() ? nullptr : found.front();
}

/// True if the word behind an option for models, or an own argument of `compare`, is a version. The
/// command then asks a service.
bool asks_for_version(const CLI::App& command, const std::vector<std::string>& words) {
  if (command.get_option_no_throw("--service") == nullptr) return false;
  for (std::size_t k = 1; k < words.size(); ++k) {
    const bool is_model = words[k - 1] == "--model" || words[k].starts_with("--model=");
    const std::string name = words[k].starts_with("--model=") ? words[k].substr(8) : words[k];
    if ((is_model || command.get_name() == "compare") && names_version(name)) return true;
  }
  return false;
}

}  // namespace

std::span<const Place> places_of_words(const std::string& command) {
  const auto found = kPlaces.find(command);
  return found == kPlaces.end() ? std::span<const Place>() : std::span<const Place>(found->second);
}

std::vector<std::string> words_by_option(const CLI::App& app, const std::vector<std::string>& words,
                                         bool cell_is_known) {
  const CLI::App* command = command_of_words(app, words);
  if (command == nullptr) return words;
  const Taken taken = taken_apart(*command, words);
  const auto free = needs_no_name(*command, taken) ? std::vector<const CLI::Option*>()
                                                   : free_places(*command, taken, cell_is_known);
  std::map<std::size_t, std::string> options;
  std::size_t place = 0;
  for (const std::size_t at : taken.bare) {
    if (place >= free.size()) break;
    options[at] = free[place]->get_name();
    if (!may_repeat(*free[place]) || place + 1 < free.size()) ++place;
  }
  std::vector<std::string> all;
  for (std::size_t k = 0; k < words.size(); ++k) {
    if (options.contains(k)) all.push_back(options[k]);
    all.push_back(words[k]);
  }
  if (asks_for_version(*command, all)) all.insert(all.begin() + 1, "--service");
  return all;
}

Result<ModelReference> parse_model_reference(const std::string& text) {
  ModelReference reference;
  const std::size_t at = text.find('@');
  reference.cell = text.substr(0, at);
  if (reference.cell.empty())
    return failure(ErrorCode::kUsage, "--model '{}': expected cell or cell@version", text)
        .of("--model")
        .with_text(text);
  if (at == std::string::npos) return reference;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + at + 1, end, reference.version);
  if (error != std::errc() || stop != end || reference.version < 1) {
    return failure(ErrorCode::kUsage, "--model '{}': expected a version from 1 after '@'", text)
        .of("--model")
        .with_text(text);
  }
  return reference;
}

bool names_version(const std::string& text) {
  std::error_code error;
  const auto reference = parse_model_reference(text);
  return reference && reference->version > 0 && !std::filesystem::exists(text, error);
}

Result<std::string> cell_id(const std::string& id_or_file) {
  if (id_or_file.ends_with(".yaml") || id_or_file.ends_with(".yml"))
    return read_cell(id_or_file).map([](const Cell& cell) { return cell.name; });
  if (id_or_file.find('@') == std::string::npos) return id_or_file;
  return failure(ErrorCode::kUsage, "--cell '{}': expected a cell, without a version", id_or_file)
      .of("--cell")
      .with_text(id_or_file)
      .next("trammel activate CELL@VERSION puts a version in force, trammel show tells of it");
}

}  // namespace trammel::cli
