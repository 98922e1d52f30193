#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

namespace trammel {

/// A kind of change: a cause that begins at a pose; its columns among those of all kinds.
struct ChangeKind {
  const CauseRecord* cause = nullptr;
  std::string spelling, behind;  ///< the parts of the source before and behind the index of its
                                 ///< first pose
  int joint = -1;                ///< 0-based; -1: of the arm
  Eigen::Index first = 0, count = 0;

  /// The source that begins at the pose with index `index`.
  [[nodiscard]] std::string from(int index) const {
    return fmt::format("{}@{}{}", spelling, index + 1, behind);
  }
};

enum class ChangesOf {
  kArm,               ///< a change on the arm
  kArmAndInstrument,  ///< and a tracker that is moved
};

/// A model that has every kind of change from the first pose on, at nothing, behind the parameters
/// of another one.
class ChangeKinds {
 public:
  ChangeKinds(const PhysicalModel& model, ChangesOf of);

  [[nodiscard]] const std::vector<ChangeKind>& kinds() const { return kinds_; }
  [[nodiscard]] const PhysicalModel& probe() const { return probe_; }
  /// The parameters of the probe: those of the model, and those of the kinds, in the order of
  /// kinds().
  [[nodiscard]] std::vector<Eigen::Index> own() const;
  [[nodiscard]] std::vector<Eigen::Index> changes() const { return places_; }

 private:
  /// Adds the cause for each tool separately, if it depends on a tool.
  void add_of_arm(const CauseRecord& cause);
  void add(const CauseRecord& cause, int joint, const std::string& behind = "");

  PhysicalModel probe_;
  std::vector<ChangeKind> kinds_;
  std::vector<Eigen::Index> places_;
};

}  // namespace trammel
