#pragma once

#include <cstddef>
#include <random>
#include <string>

/// Changes inputs so that they stay near to what a reader takes.
namespace trammel::fuzz {

using Random = std::mt19937_64;
/// A changed `input`, at most `longest` bytes where the change can keep to that.
using Mutation = std::string (*)(const std::string& input, Random& random, std::size_t longest);

/// Flips, removes, repeats and replaces bytes.
[[nodiscard]] std::string mutate_bytes(const std::string& input, Random& random,
                                       std::size_t longest);
/// The same, and words that readers of text know or fear: numbers at limits, separators, escapes.
[[nodiscard]] std::string mutate_text(const std::string& input, Random& random,
                                      std::size_t longest);
/// The same, and whole lines and fields of a table.
[[nodiscard]] std::string mutate_table(const std::string& input, Random& random,
                                       std::size_t longest);
/// The same for YAML: indentation, anchors and aliases, flow.
[[nodiscard]] std::string mutate_yaml(const std::string& input, Random& random,
                                      std::size_t longest);
/// Changes values of a JSON text where they stand; of a text that is none, its bytes.
[[nodiscard]] std::string mutate_json(const std::string& input, Random& random,
                                      std::size_t longest);
/// The same of a model file, whose hashes then fit again in most cases.
[[nodiscard]] std::string mutate_model(const std::string& input, Random& random,
                                       std::size_t longest);
/// Changes lengths, enumerators and numbers of a serialized sample, and its bytes.
[[nodiscard]] std::string mutate_cdr(const std::string& input, Random& random, std::size_t longest);

/// The model file with the hashes that its parts have now; the text itself where it is no JSON
/// object.
[[nodiscard]] std::string with_fitting_hashes(const std::string& model);

}  // namespace trammel::fuzz
