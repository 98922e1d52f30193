#pragma once

#include <optional>
#include <string_view>

namespace trammel {

/// The reason why a new model is not put in force automatically, whatever its held-out poses say: a
/// person decides.
enum class HeldBack {
  kNo,         ///< the poses held out decide
  kFewJudges,  ///< too few poses can judge it; nothing speaks against it or its batch
  kStopNote,   ///< it has a note of severity stop: see stop_of()
  kStepLimit   ///< it would move a recently requested pose by more than the cell's step limit
};
/// The spelling for programs: `few_judges stop_note step_limit`; empty for kNo.
[[nodiscard]] const char* to_text(HeldBack reason);
/// kNo where there is no such reason.
[[nodiscard]] HeldBack held_back_of(std::string_view text);

/// True if the batch of such a model is doubtful. Then no later training learns from it until a
/// model that learned from it has been in force.
[[nodiscard]] constexpr bool is_doubt(HeldBack reason) {
  return reason == HeldBack::kStopNote || reason == HeldBack::kStepLimit;
}

}  // namespace trammel
