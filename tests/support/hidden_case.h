#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/hidden_world.h"

/// Draws a cell, hides an effect in it and measures it. The program under test gets the three files
/// and nothing more.
namespace trammel::hidden {

/// The question to the program that reads the files.
enum class Question {
  kName,     ///< these poses show the hidden cause
  kNothing,  ///< nothing that has a name is there: naming one is wrong
  kUnknown,  ///< a function of some joints that no cause makes
  kAbstain,  ///< the hidden cause cannot be separated from another one: the set must contain it
};

struct HiddenSpec {
  /// A cause (`backlash`), several (`backlash+outlier`, `mixture2`, `mixture3`), a null
  /// (`null_white`, `null_structured`, `null_permuted`), an unknown (`unknown_q4`, `unknown_q2q3`),
  /// a slow effect that is no cause (`slow_zero`, `slow_stand`, `slow_growth`, `slow_walk`), an
  /// effect of another form than any cause (`foreign_wave`, `foreign_wobble`, `foreign_foot`,
  /// `foreign_walks`, `foreign_loads`, `foreign_scale`), an undecidable pair (`backlash_one_side`,
  /// `payload_alone`, `tool_or_link`, `tool_absorbed`, `joint1_or_tracker`, `joint6_or_tool`,
  /// `constant_warmth`) or a replica of the source's studies (`replica_ripple_1dim`,
  /// `replica_ripple_6dim`, `replica_tool`, `replica_p28`).
  std::string kind = "gear_transmission";
  std::uint64_t seed = 1;
  /// Squared length of each effect over sigma, outside the span of the cell's error sources and the
  /// other hidden effects. An effect inside that span gets a realistic size.
  double lambda = 60;
  int poses = 300;
  bool orientation = true;
  std::string ranges = "calibration";
  std::string cell_ranges = {};  ///< the ranges in the cell file; empty: `ranges`
  double validation_share = 0;
  /// Columns of the batch that are not recorded, by the beginnings of their names: `dir`, `time_s`.
  std::vector<std::string> withheld = {};
  /// `white`, `heavy` (Student's, of four degrees of freedom) or `lasting` (a part of each error
  /// stays in the next one), all of the tracker's size.
  std::string noise = "white";
};

struct HiddenTruth {
  std::string kind;
  Question question = Question::kName;
  std::vector<HiddenCause> causes;  ///< one an effect
  std::vector<double> lambdas;      ///< one an effect, as reached
  std::vector<double> absorbed;     ///< share of each effect (of its square) that the rest can make
  /// First and last row at which an answer may place the beginning of each effect. A shift between
  /// them makes no noticeable difference. Both -1 without a beginning.
  std::vector<std::pair<int, int>> begins;
  /// The quantity on which it depends was not recorded, and the order of the rows does not show it.
  bool untraceable = false;
};

struct HiddenCase {
  std::string batch_csv, cell_yaml, robot_yaml;
  HiddenTruth truth;
  World world;              ///< for oracles
  std::string cell_ranges;  ///< the joint ranges in the cell file
  Frames measured;          ///< with noise
};

[[nodiscard]] HiddenCase hide(const HiddenSpec& spec);

/// All names of a spec that stand for one decidable cause.
[[nodiscard]] const std::vector<std::string>& decidable_kinds();
[[nodiscard]] const std::vector<std::string>& null_kinds();
[[nodiscard]] const std::vector<std::string>& unknown_kinds();
[[nodiscard]] const std::vector<std::string>& slow_kinds();
[[nodiscard]] const std::vector<std::string>& foreign_kinds();
[[nodiscard]] const std::vector<std::string>& undecidable_kinds();
[[nodiscard]] const std::vector<std::string>& replica_kinds();

/// The sealed truth as JSON.
[[nodiscard]] std::string to_json(const HiddenTruth& truth, const World& world);

}  // namespace trammel::hidden
