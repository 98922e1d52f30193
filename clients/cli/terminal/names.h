#pragma once

#include <span>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace CLI {
class App;
}

/// How a command line names cells, versions of their models, model files, batches and jobs.
namespace trammel::cli {

/// `cell` or `cell@version`, as people name a model that a service has.
struct ModelReference {
  std::string cell;
  int version = 0;  ///< 0: the one in force
};
[[nodiscard]] Result<ModelReference> parse_model_reference(const std::string& text);

/// True of `cell@version`, unless a file is called so.
[[nodiscard]] bool names_version(const std::string& text);

/// The id of a cell from what --cell says: the id, or a cell file that holds it. Refuses (kUsage) a
/// version.
[[nodiscard]] Result<std::string> cell_id(const std::string& id_or_file);

/// An option that a bare word may stand for: `trammel activate cell-7@3` for `--model cell-7@3`.
struct Place {
  std::string option, word;  ///< `--model`, and `CELL@VERSION` as help calls it
};
/// The options for which the bare words of a command stand, in their order; the last one takes all
/// that follow where it may be said several times.
[[nodiscard]] std::span<const Place> places_of_words(const std::string& command);

/// `words` of a command line (without the program's name) with an option in front of each bare word
/// that stands for one, and --service behind a version where the command may ask a service. What an
/// option says already takes no bare word. `cell_is_known`: a cell need not be named.
[[nodiscard]] std::vector<std::string> words_by_option(const CLI::App& app,
                                                       const std::vector<std::string>& words,
                                                       bool cell_is_known);

}  // namespace trammel::cli
