#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/plan/single_causes.h"

/// The smallest effect of a single cause that can still be seen at given poses.
///
/// A pose shows r = B b + T t + s theta + e, with e of covariance S. The base b is free, and so is
/// the tool t if it is new. After whitening, and with both refitted, the effect s has the squared
/// length lambda. A test of k numbers sees it with the chance that a noncentral chi-square of k
/// degrees of freedom and noncentrality lambda exceeds the test's limit. The size of an effect is
/// its rms position over the working poses of the robot, with base and tool refitted there as well.
namespace trammel {

/// One possible effect of a cause, scaled to 1 m rms over the working poses.
struct CauseSignal {
  std::size_t cause = 0;        ///< index in CauseEffects::causes()
  Eigen::VectorXd weights;      ///< K, of PoseEffects::by_cause
  double order = 0, phase = 0;  ///< for a function of the joint's angle: sin(order q + phase) times
                                ///< the weighted column
};
/// 6: its effect at a pose, m and rad, in B.
[[nodiscard]] Vector6 signal_at(const CauseSignal& signal, const CauseEffects& effects,
                                const PoseEffects& at, const JointVector& q);

/// The effect of the causes over the poses that a robot works at.
class WorkingPoses {
 public:
  /// `new_tool`: the tool is refitted as well.
  WorkingPoses(const CauseEffects& effects, const std::vector<PoseContext>& poses, bool new_tool);

  /// m, rms over the poses of the part of an effect (3 M, m) that refitting base and tool leaves.
  [[nodiscard]] double left_rms(const Eigen::VectorXd& effect) const;
  /// k x k, m²: w' (this) w is the square of left_rms() of these columns with weights w.
  [[nodiscard]] Eigen::MatrixXd left_square(const std::vector<Eigen::Index>& columns) const;
  /// m, rms: the effect of an error in the angle of that column's joint alone. The error is any
  /// function of the angle with an rms of one prior scale.
  [[nodiscard]] double any_function_rms(Eigen::Index column) const;
  /// Directions and shapes of each cause, drawn with `seed` and scaled to 1 m. A cause has no
  /// signal if a motion of base and tool compensates its whole effect.
  [[nodiscard]] std::vector<CauseSignal> signals(const CauseEffects& effects,
                                                 std::uint64_t seed) const;

 private:
  /// 3 M, m.
  [[nodiscard]] Eigen::VectorXd effect(const CauseSignal& signal, Eigen::Index joint) const;
  [[nodiscard]] bool scaled_to_one(CauseSignal& signal, Eigen::Index joint) const;
  void add_signals(const CauseEffects& effects, std::size_t cause, std::uint64_t seed,
                   std::vector<CauseSignal>& all) const;

  std::vector<PoseContext> poses_;
  Eigen::MatrixXd by_cause_;  // 3 M x K
  Eigen::MatrixXd frames_;    // 3 M x f, orthonormal: the effects of base and tool
};

/// The size (m) at which signals of these strengths (lambda at 1 m; equally likely) are seen with
/// chance `power` by a test of `freedom` numbers with the false alarm rate `false_alarm`. Empty if
/// no signal would be seen.
[[nodiscard]] std::optional<double> smallest_seen(const std::vector<double>& strengths, int freedom,
                                                  double false_alarm, double power);

}  // namespace trammel
