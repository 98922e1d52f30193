#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/plan/single_causes.h"

/// The smallest effect of a single cause that can still be seen at given poses.
///
/// A pose shows r = B b + T t + s theta + e, e of covariance S: the base b stands anywhere, so does
/// the tool t where it is a new one. What is left of the effect s after whitening and after both
/// are refitted has the squared length lambda. A test of k numbers sees it with the chance that a
/// noncentral chi-square of k degrees of freedom and noncentrality lambda is above the test's
/// limit. An effect is as large as it is over the poses that the robot works at, rms of the
/// position, base and tool refitted there likewise.
namespace trammel {

/// One way in which a cause may show, of 1 m rms over the working poses.
struct CauseSignal {
  std::size_t cause = 0;        ///< index in CauseEffects::causes()
  Eigen::VectorXd weights;      ///< K, of PoseEffects::by_cause
  double order = 0, phase = 0;  ///< of a function of the joint's angle: sin(order q + phase) of the
                                ///< weighted column
};
/// 6: what it does at a pose, m and rad, in B.
[[nodiscard]] Vector6 signal_at(const CauseSignal& signal, const CauseEffects& effects,
                                const PoseEffects& at, const JointVector& q);

/// The effect of the causes over the poses that a robot works at.
class WorkingPoses {
 public:
  /// `new_tool`: the tool is refitted as well.
  WorkingPoses(const CauseEffects& effects, const std::vector<PoseContext>& poses, bool new_tool);

  /// m, rms over the poses of what an effect (3 M, m) leaves when base and tool are refitted.
  [[nodiscard]] double left_rms(const Eigen::VectorXd& effect) const;
  /// k x k, m²: the square of left_rms() of these columns with weights w is w' (this) w.
  [[nodiscard]] Eigen::MatrixXd left_square(const std::vector<Eigen::Index>& columns) const;
  /// m, rms: of an error of that column's joint alone, whose angle is off by one prior scale, rms,
  /// anyhow.
  [[nodiscard]] double any_function_rms(Eigen::Index column) const;
  /// Directions and shapes of each cause, drawn with `seed` and scaled to 1 m. A cause whose effect
  /// a motion of base and tool makes up for has none.
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
  Eigen::MatrixXd frames_;    // 3 M x f, orthonormal: what base and tool can make
};

/// The size (m) at which signals of these strengths (lambda at 1 m; each as likely as the other)
/// are seen with chance `power` by a test of `freedom` numbers that has false alarms with chance
/// `false_alarm`. Empty where none would be.
[[nodiscard]] std::optional<double> smallest_seen(const std::vector<double>& strengths, int freedom,
                                                  double false_alarm, double power);

}  // namespace trammel
