#pragma once

#include <utility>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/rapid/interpreter.h"
#include "clients/cam/rapid/syntax.h"

/// In which order the statements of RAPID modules may come.
namespace trammel::cam::rapid {

/// An instruction, or a word that decides the order.
struct Place {
  std::size_t module = 0;
  const Instruction* instruction = nullptr;  ///< nullptr: a word, or an assignment
  const Assignment* assignment = nullptr;
};

/// The statements of all modules in sequence, and their places.
[[nodiscard]] std::pair<std::vector<Step>, std::vector<Place>> steps_of(
    const std::vector<SourceFile>& files, const std::vector<Module>& modules,
    const Interpreter& meaning);

}  // namespace trammel::cam::rapid
