#pragma once

#include <map>
#include <optional>
#include <string>

#include "clients/cam/program.h"
#include "server/base/units.h"
#include "server/robot/inverse_kinematics.h"

/// The joints that a controller takes for a target, given the configuration in the program.
namespace trammel::cam {

/// rad, beyond a quarter turn: in another branch joint 4 differs by half a turn, so a joint with a
/// smaller difference is in the intended branch. Controllers demand no more.
constexpr double kNextQuarter = kPi / 4;

struct NominalJoints {
  std::optional<JointVector> q;  ///< rad; empty: none found
  std::optional<int> conf;       ///< the branch, where the arm has numbered branches
  std::string why_not;
  std::string doubt = {};  ///< the contradiction in the program's configuration; empty: none
};

/// Robot arm with its rail, if any, as a chain and as the six turning axes alone.
class ArmOfProgram {
 public:
  explicit ArmOfProgram(const Chain& robot);

  /// Joints for X_BF. `previous`: the joints after the motion before, which decide whatever the
  /// program leaves open; without them it takes the joints nearest to zero.
  [[nodiscard]] NominalJoints joints(const Pose& X_BF, const Configuration& said,
                                     const std::map<int, double>& external,
                                     const std::optional<JointVector>& previous) const;
  /// The joints for X_BF that are nearest to `from`. `on_a_line`: only of the posture of `from`,
  /// which a line does not leave. Two postures that are equally near are not decided.
  [[nodiscard]] NominalJoints nearest(const Pose& X_BF, const std::map<int, double>& external,
                                      const JointVector& from, bool on_a_line) const;
  /// The chain's joints from a dialect's axes (deg) and external axes (mm); empty where the rail's
  /// value is missing.
  [[nodiscard]] std::optional<JointVector> from_axes(const std::vector<double>& axes,
                                                     const std::map<int, double>& external) const;
  [[nodiscard]] std::vector<double> to_axes(const JointVector& q) const;
  /// The joints near `q` that bring the flange to X_BF, with the rail unmoved.
  [[nodiscard]] JointVector near(const Pose& X_BF, const JointVector& q) const;
  [[nodiscard]] bool has_rail() const { return !rails_.empty(); }
  [[nodiscard]] const Chain& robot() const { return robot_; }

 private:
  struct Rail {
    Chain arm;  ///< the turning axes
    Pose X_BR;  ///< its base on the rail
  };
  /// The arm on its rail, where the rail comes first.
  [[nodiscard]] std::optional<Rail> arm_on(double rail) const;
  /// The joints that `solve(arm, X_RF, previous)` finds for the turning axes, with the rail's value
  /// in front.
  template <typename Solve>
  [[nodiscard]] NominalJoints on_rail(const Pose& X_BF, const std::map<int, double>& external,
                                      const std::optional<JointVector>& previous,
                                      const Solve& solve) const;
  [[nodiscard]] std::optional<JointVector> branch(const Chain& arm, const Pose& X_BF, int number,
                                                  const JointVector& near) const;
  /// The branches of `q`; several where they meet.
  [[nodiscard]] std::vector<int> branches_of(const Chain& arm, const JointVector& q) const;
  [[nodiscard]] NominalJoints nearest_branch(const Chain& arm, const Pose& X_BF,
                                             const JointVector& from, bool on_a_line) const;
  [[nodiscard]] std::optional<JointVector> by_branches(const Chain& arm, const Pose& X_BF,
                                                       const Configuration& said,
                                                       const std::optional<JointVector>& previous,
                                                       std::optional<int>& conf) const;
  [[nodiscard]] NominalJoints by_descent(const Pose& X_BF, const std::map<int, double>& external,
                                         const std::optional<JointVector>& previous) const;

  Chain robot_;
  std::vector<int> turning_, rails_;
  bool wrist_;              ///< the turning axes are an elbow arm with a spherical wrist
  bool offset_wrist_;       ///< or one as offset_wrist.h describes it
  bool bends_down_ = true;  ///< positive joint 5 bends the tool downward
};

/// True if the axes (deg) are as the program states them. If the program contradicts itself, they
/// must be as in the previous target (none: not known). `beyond_quarter`: rad, how far a joint may
/// leave its stated quarter turn.
[[nodiscard]] bool keeps_configuration(const Configuration& said, const std::vector<double>& before,
                                       const std::vector<double>& now, double beyond_quarter = 0);

}  // namespace trammel::cam
