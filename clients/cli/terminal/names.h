#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace CLI {
class App;
}

/// The way in which a command line names cells, versions of their models, model files, batches and
/// jobs.
namespace trammel::cli {

/// `cell` or `cell@version`: a person's name for a model of a service.
struct ModelReference {
  std::string cell;
  int version = 0;  ///< 0: the one in force
};
[[nodiscard]] Result<ModelReference> parse_model_reference(const std::string& text);

/// True for `cell@version`, unless a file has that name.
[[nodiscard]] bool names_version(const std::string& text);

/// The id of a cell from the value of --cell: the id, or a cell file that contains it. Refuses
/// (kUsage) a version.
[[nodiscard]] Result<std::string> cell_id(const std::string& id_or_file);

/// An option that a bare word may stand for: `trammel activate cell-7@3` for `--model cell-7@3`.
struct Place {
  std::string option, word;  ///< `--model`, or `CELL@VERSION` as in the help
};
/// The options for which the bare words of a command stand, in their order. The last one takes all
/// remaining words if it may occur several times.
[[nodiscard]] std::span<const Place> places_of_words(const std::string& command);

/// `words` of a command line (without the program's name), with an option in front of each bare
/// word that stands for one. Adds --service behind a version if the command may ask a service. An
/// option that is already given takes no bare word. `cell_is_known`: the words need not name a
/// cell.
[[nodiscard]] std::vector<std::string> words_by_option(const CLI::App& app,
                                                       const std::vector<std::string>& words,
                                                       bool cell_is_known);

}  // namespace trammel::cli
