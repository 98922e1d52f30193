#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"
#include "tests/fuzz/mutate.h"

/// What reads bytes from outside, one target for each reader. A target must end with an answer,
/// whatever the bytes are: a crash, an exception or a sanitizer's report is an error of the reader.
namespace trammel::fuzz {

struct Target {
  const char* name;
  /// Reads the bytes. Says in a few words what came of it, without numbers: inputs that end in the
  /// same words are alike.
  std::string (*run)(std::string_view bytes);
  Mutation mutate;
  /// Inputs to start from besides those of corpus/NAME; none where nullptr.
  std::vector<std::string> (*seeds)() = nullptr;
  std::size_t longest = std::size_t{1} << 16;  ///< bytes that a mutation may make of an input
};

/// Those of this executable.
[[nodiscard]] const std::vector<Target>& targets();
/// By name; nullptr if there is none.
[[nodiscard]] const Target* find_target(std::string_view name);

/// What Target::run() says of a refusal: its words without names and numbers. Ends the process if
/// the sentence of the refusal could control a terminal.
[[nodiscard]] std::string words_of(const struct trammel::Error& error);

}  // namespace trammel::fuzz
