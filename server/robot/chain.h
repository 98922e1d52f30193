#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/pose.h"

/// The nominal robot: a serial chain of n joints, one DH or Hayati row for each.
namespace trammel {

enum class JointType { kRevolute, kPrismatic };

constexpr int kMaxJoints =
    12;  // of a chain; computations at every pose use fixed storage of this size

/// One number per joint.
using JointArray = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;

/// The five numbers of a link. Link i is Tz(d) Rz(theta) Tx(a) Rx(alpha), eq. (3.3), or, where the
/// axis is parallel to the next one, Rz(theta) Tx(a) Rx(alpha) Ry(beta), eq. (3.4). m, rad.
struct LinkGeometry {
  double theta = 0;
  double d = 0;
  double a = 0;
  double alpha = 0;
  double beta = 0;
};

/// One joint and the link that follows it.
struct Joint {
  JointType type = JointType::kRevolute;
  LinkGeometry link;  ///< nominal; theta (revolute) or d (prismatic) is the offset at joint value 0
  bool hayati = false;  ///< this link has the parameter beta instead of d
  double sign = 1;      ///< -1 where the controller counts against the right-hand rule, else +1
  double lower = -std::numeric_limits<double>::infinity();  ///< rad (m), of the commanded value
  double upper = std::numeric_limits<double>::infinity();
  double gear_ratio = 0;        ///< motor turns per joint turn; 0 when unknown
  double compliance_prior = 0;  ///< rad/Nm
  double mass = 0;  ///< kg, of the link that follows; 0: the controller compensates its weight
  Vector3 p_cog =
      Vector3::Zero();  ///< m, its centre of gravity in the link's own frame (at its far end)
  std::optional<double> max_speed;  ///< rad/s (m/s)
};

/// The part that makes a joint follow another one; server/robot/README.md explains the effect on
/// the gears.
enum class CouplingKind {
  kController,  ///< the controller's way of counting; the arm is serial, each gear sits between two
                ///< links
  kParallelogram,  ///< bars: the gear of the joint turns its link against the base, whatever the
                   ///< other joint does
};

/// The spelling in robot files.
[[nodiscard]] const char* to_string(CouplingKind kind);

/// Joint `joint` moves by `ratio` times the commanded value of joint `follows` in addition to its
/// own (0-based).
struct Coupling {
  int joint = 0;
  int follows = 0;
  double ratio = 0;
  CouplingKind kind = CouplingKind::kController;
};

/// A robot as its maker describes it. An immutable value.
class Chain {
 public:
  Chain() = default;
  /// Refuses a chain without joints or with more than kMaxJoints, an empty or reversed limit
  /// (except 0 to 0, a passive joint, see passive_joint.h), and a coupling with a missing joint or
  /// with itself.
  [[nodiscard]] static Result<Chain> make(std::string name, std::vector<Joint> joints,
                                          std::vector<Coupling> couplings = {});

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] int size() const { return static_cast<int>(joints_.size()); }
  [[nodiscard]] const Joint& joint(int i) const { return joints_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const std::vector<Coupling>& couplings() const { return couplings_; }
  /// n x n: d(kinematic joint value)/d(commanded joint value): signs and couplings.
  [[nodiscard]] const Eigen::MatrixXd& transmission() const { return transmission_; }
  /// n x n: d(kinematic joint value)/d(gear angle): signs and couplings by bars.
  [[nodiscard]] const Eigen::MatrixXd& drive() const { return drive_; }
  /// n x n: drive() for gears that are counted as their axes turn. It maps the deflections of the
  /// gears to the joints; its transpose maps torques about the axes to torques on the gears.
  [[nodiscard]] const Eigen::MatrixXd& bars() const { return bars_; }
  /// True if bars couple joints: else bars() is the identity.
  [[nodiscard]] bool has_bars() const { return has_bars_; }
  /// True if the controller counts the angles of the gears: else gear_angles() changes something.
  [[nodiscard]] bool counts_gears() const { return transmission_ == drive_; }
  /// The angles of the gears at the commanded `q`; commanded() is the way back. Linear: of
  /// differences as well.
  [[nodiscard]] JointVector gear_angles(const JointVector& q) const;
  [[nodiscard]] JointVector commanded(const JointVector& gears) const;

  /// The nominal links with the joints at the commanded `q`.
  [[nodiscard]] std::vector<LinkGeometry> links_at(const JointVector& q) const;
  /// X_BF at the commanded `q` (size n), eq. (3.2) without base and tool.
  [[nodiscard]] Pose flange_pose(const JointVector& q) const;
  /// 6 x n geometric Jacobian of the point `p_F` (m, in F): [dp; rotation vector] in B per
  /// commanded joint, eq. (3.7).
  [[nodiscard]] Eigen::MatrixXd jacobian(const JointVector& q,
                                         const Vector3& p_F = Vector3::Zero()) const;
  /// The Jacobian per gear angle.
  [[nodiscard]] Eigen::MatrixXd gear_jacobian(const JointVector& q,
                                              const Vector3& p_F = Vector3::Zero()) const;
  /// True if any link's weight is known.
  [[nodiscard]] bool has_link_masses() const;
  /// Index of the first joint outside its limits (beyond `tolerance`), if any.
  [[nodiscard]] std::optional<int> joint_outside_limits(const JointVector& q,
                                                        double tolerance = 1e-9) const;

 private:
  std::string name_;
  std::vector<Joint> joints_;
  std::vector<Coupling> couplings_;
  Eigen::MatrixXd transmission_, drive_, bars_;
  bool has_bars_ = false;
};

}  // namespace trammel
