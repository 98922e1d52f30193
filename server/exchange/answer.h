#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/exchange/values.h"

/// Questions to a model, and the identity of the model that answered.
namespace trammel::exchange {

/// True for each joint that is a rail; its values are in mm. A joint beyond the end of the list is
/// no rail.
using Rails = std::vector<bool>;
[[nodiscard]] inline bool is_rail(const Rails& rails, std::size_t joint) {
  return joint < rails.size() && rails[joint];
}

/// The approach of the arm to a pose; unknown values are neutral.
struct Approach {
  std::vector<int> directions = {};  ///< of each joint: -1, 0, +1; empty: not known
  std::optional<double> temperature_c = {};
  std::optional<double> time_s = {};
};

/// Joints of a question. They stay rad, as on the wire and in records: a conversion to degrees
/// would change their last bit, and a repeated record must give the same answer to the last bit.
struct AskedJoints {
  std::vector<double> q_rad;  ///< of a rail mm
  Approach approach = {};
};

/// A target that is to be corrected.
struct AskedTarget {
  Pose pose;                     ///< X_BT; ignored for a joint target
  std::vector<double> seed_rad;  ///< as AskedJoints::q_rad; empty when `conf` says the branch
  std::optional<int> conf;
  bool joint_target = false;
  Approach approach = {};
};

/// Which model answered. Ages count from when it answered.
struct ModelInfo {
  std::string cell, id, hash, level, batch_id;
  std::string batch_hash;  ///< empty: not recorded
  int version = 0;
  std::int64_t trained_at_unix_s = 0;
  double training_age_s = 0;
  std::optional<std::int64_t> measured_at_unix_s =
      {};                                 ///< of its newest measurement; empty: not recorded
  std::optional<double> data_age_s = {};  ///< the age of that measurement
  int training_poses = 0;
  std::optional<double> validation_rms_mm = {};  ///< empty: nothing was held out
  bool in_force = false;
  /// Notes for users of the model, the gravest first. In a list of versions only the one in force
  /// has them.
  std::vector<Note> notes = {};
  /// Where the millimetres come from, for people, of the one in force; empty in other answers.
  std::vector<std::string> budget = {};
};

template <typename T>
struct Answer {
  ModelInfo model;  ///< all items come from this one
  std::vector<T> items;
};

}  // namespace trammel::exchange
