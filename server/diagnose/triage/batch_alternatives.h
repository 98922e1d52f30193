#pragma once

#include <string>
#include <vector>

#include "server/diagnose/triage/batch_comparison.h"

namespace trammel::batch_triage {

/// True if the tracker sees the cause as a displaced base.
[[nodiscard]] bool moves_base(const CauseRecord& record);

/// The alternatives that a model and a batch allow.
class Alternatives {
 public:
  explicit Alternatives(const Comparison& comparison)
      : physics_(comparison.model().parts().physics), X_WB_(comparison.located_base(physics_)) {}

  [[nodiscard]] Alternative none() const;
  /// One cause each, from pose `first` (0: the whole batch) on.
  [[nodiscard]] std::vector<Alternative> from(int first, const std::string& pose_id) const;
  /// The alternatives of the whole batch, while the tracker stands elsewhere.
  [[nodiscard]] std::vector<Alternative> with_the_tracker() const;

 private:
  /// True if the model lets a payload show.
  [[nodiscard]] bool carries() const;
  void add_drift(std::vector<Alternative>& all) const;

  const PhysicalModel& physics_;
  const Pose X_WB_;
};

}  // namespace trammel::batch_triage
