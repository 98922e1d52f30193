#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "clients/cam/flow.h"
#include "clients/cam/urscript/values.h"

/// The words of a script that control the order, and the functions that move the robot or change
/// settings.
namespace trammel::cam::urscript {

/// The axes are commanded, and the tool may take any way.
[[nodiscard]] bool is_of_axes(const Token& word);
[[nodiscard]] bool is_motion(const Token& word);
/// `servoj`, `freedrive_mode`: the arm goes to a place that no pose gives.
[[nodiscard]] bool is_followed(const Token& word);

/// A statement.
struct Statement {
  Step step;
  std::size_t at = 0;                ///< the token of its word
  const Assignment* sets = nullptr;  ///< for a variable with several constants
};
/// Statements in the order of the text; calls in an assignment come before it.
[[nodiscard]] std::vector<Statement> statements_of(const Tokens& tokens, const Values& values);

/// Why a script is not whole: `def`, `if` and `while` have an `end` each.
[[nodiscard]] std::optional<Cut> cut_in(const Tokens& tokens, std::size_t file);

}  // namespace trammel::cam::urscript
