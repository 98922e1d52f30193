#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/hidden_world.h"

/// Draws a cell, hides an effect in it and measures it. Whoever is to find the effect gets the
/// three files and no more.
namespace trammel::hidden {

/// What is asked of whoever reads the files.
enum class Question {
  kName,     ///< what was hidden can be told from these poses
  kNothing,  ///< nothing that has a name is there: naming one is wrong
  kUnknown,  ///< a function of some joints that no cause makes
  kAbstain,  ///< what was hidden cannot be told from something else: the set must hold it
};

struct HiddenSpec {
  /// A cause (`backlash`), several (`backlash+outlier`, `mixture2`, `mixture3`), a null
  /// (`null_white`, `null_structured`, `null_permuted`), an unknown (`unknown_q4`, `unknown_q2q3`),
  /// something slow that no cause is
  /// (`slow_zero`, `slow_stand`, `slow_growth`, `slow_walk`), something of another form than any
  /// cause
  /// (`foreign_wave`, `foreign_wobble`, `foreign_foot`, `foreign_walks`, `foreign_loads`,
  /// `foreign_scale`), what cannot be decided
  /// (`backlash_one_side`, `payload_alone`, `tool_or_link`, `tool_absorbed`, `joint1_or_tracker`,
  /// `joint6_or_tool`, `constant_warmth`) or a replica of the source's studies
  /// (`replica_ripple_1dim`, `replica_ripple_6dim`, `replica_tool`, `replica_p28`).
  std::string kind = "gear_transmission";
  std::uint64_t seed = 1;
  /// Squared length of each effect over sigma, outside what the cell's error sources and the other
  /// effects hidden can make. Sizes of effects that these absorb whole are as robots show them.
  double lambda = 60;
  int poses = 300;
  bool orientation = true;
  std::string ranges = "calibration";
  std::string cell_ranges = {};  ///< that the cell allows; empty: `ranges`
  double validation_share = 0;
  /// Columns of the batch that nobody recorded, by how their names begin: `dir`, `time_s`.
  std::vector<std::string> withheld = {};
  /// `white`, `heavy` (Student's, of four degrees of freedom) or `lasting` (an error is left in the
  /// next one), all of the tracker's size.
  std::string noise = "white";
};

struct HiddenTruth {
  std::string kind;
  Question question = Question::kName;
  std::vector<HiddenCause> causes;  ///< one an effect
  std::vector<double> lambdas;      ///< one an effect, as reached
  std::vector<double> absorbed;     ///< share of each effect (of its square) that the rest can make
  /// First and last row from which each effect may be said to begin: what lies between makes too
  /// little difference to be noticed. Both -1 where it has no beginning.
  std::vector<std::pair<int, int>> begins;
  /// What it follows was neither recorded nor can be told from the order of the rows.
  bool untraceable = false;
};

struct HiddenCase {
  std::string batch_csv, cell_yaml, robot_yaml;
  HiddenTruth truth;
  World world;              ///< for oracles
  std::string cell_ranges;  ///< that the cell allows its joints
  Frames measured;          ///< with noise
};

[[nodiscard]] HiddenCase hide(const HiddenSpec& spec);

/// Everything a spec may name that stands for one cause and can be told.
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
