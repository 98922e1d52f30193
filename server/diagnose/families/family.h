#pragma once

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

/// Candidates for effects missing from a model: groups of whitened columns. A family is one cause
/// (of one joint) with the quantity that is searched within it: an order, the first pose, a length
/// scale.
namespace trammel::cause_search {

/// The member of a family that explains a data vector best. A family has at most one of order, pose
/// and length scale.
struct Best {
  double evidence =
      0;  ///< nat: log marginal likelihood relative to no effect, with the size chosen by the data
  double strength = 0;           ///< squared whitened size of the explained part
  int freedom = 0;               ///< the number of its parameters
  double order = 0;              ///< of a gear: cycles a joint turn; 0: none yet
  Eigen::Index pose = 0;         ///< place in the batch at which it begins, or of the outlier
  std::size_t length_scale = 0;  ///< for a smooth function: index among the length scales of its
                                 ///< family
  double size = 1;               ///< of a smooth function: its standard deviation, SI
};

/// A scan summed pose by pose, for columns g(row) f(pose) that differ only in the function f of the
/// pose.
struct Shares {
  Eigen::MatrixXd along;   ///< N x k: g's rows of each pose times those of the projected data
  Eigen::VectorXd square;  ///< N: g's own
};
/// Columns g that several families share, by name.
struct KnownShares {
  std::map<std::string, Shares> of_data;
  std::map<std::string, Eigen::MatrixXd> of_root;
};

/// The rows as one scan sees them, with one set of data.
struct View {
  const Background& background;  ///< with zeros in the left-out rows
  const Eigen::VectorXd* keep =
      nullptr;  ///< R: 1 for a scanned row, 0 for a left-out one; null: all rows
  std::shared_ptr<KnownShares> known = std::make_shared<KnownShares>();
};

/// `name`: the name of `g`; equal names are summed once per view.
[[nodiscard]] const Shares& shares_of(const LinearProblem& problem, const View& view,
                                      const std::string& name, const Eigen::VectorXd& g,
                                      const Eigen::MatrixXd& projected);
/// N x p: the same sums with the background's root.
[[nodiscard]] const Eigen::MatrixXd& root_shares_of(const LinearProblem& problem, const View& view,
                                                    const std::string& name,
                                                    const Eigen::VectorXd& g);

/// A family's own numbers beside a background, whatever the data: many sets of data are scanned
/// beside one. Kept for the last background all of whose rows were scanned. Not for two threads.
template <typename T>
class BesideBackground {
 public:
  /// As made by `make` for this view, now or before.
  template <typename Make>
  [[nodiscard]] T& of(const View& view, const Make& make) const {
    if (view.keep != nullptr) return some_rows_ = make();
    if (background_ != view.background.identity()) {
      all_rows_ = make();
      background_ = view.background.identity();
    }
    return all_rows_;
  }

 private:
  mutable std::shared_ptr<const int> background_;
  mutable T all_rows_, some_rows_;
};

/// nat: of `freedom` numbers of equal prior variance, chosen by the data, that explain `strength`.
[[nodiscard]] double log_evidence(double strength, double freedom);
/// The strength at which log_evidence() is `evidence`.
[[nodiscard]] double strength_for(double evidence, double freedom);

class Family {
 public:
  virtual ~Family() = default;
  Family() = default;
  Family(const Family&) = delete;
  Family& operator=(const Family&) = delete;

  [[nodiscard]] virtual Cause cause(const Best& best) const = 0;
  /// The spelling in a cell file; empty if no error source describes it.
  [[nodiscard]] virtual std::string source(const Best&) const { return {}; }
  /// False: a function of some joints that no physics stands behind.
  [[nodiscard]] virtual bool named() const { return true; }
  /// The circumstances that an anonymous family depends on: `q4`, `time`.
  [[nodiscard]] virtual std::vector<std::string> depends_on() const { return {}; }
  /// The slowly moving part, for people, if the family knows nothing more: `the zero of joint 3`;
  /// else empty.
  [[nodiscard]] virtual std::string wanderer() const { return {}; }
  /// False if the member says nothing about other poses.
  [[nodiscard]] virtual bool predicts() const { return true; }
  /// The name among the other families: the same on every background.
  [[nodiscard]] std::string label() const;
  /// nat: by how much it is less expected than other causes.
  [[nodiscard]] virtual double surprise() const { return 0; }
  /// The best member for each column of `projected` (R x k: S⁻¹ y).
  [[nodiscard]] virtual std::vector<Best> scan(const View& view,
                                               const Eigen::MatrixXd& projected) const = 0;
  /// R x m: in units of priors (of the fitted size, where that is known).
  [[nodiscard]] virtual Eigen::MatrixXd columns(const Best& best) const = 0;
  /// A typical member, used where none was found.
  [[nodiscard]] virtual Best typical() const { return {}; }
};

using FamilyPtr = std::unique_ptr<Family>;

/// A cause whose effect is a fixed set of columns; `chosen` of the effect's.
[[nodiscard]] FamilyPtr make_fixed_family(const LinearProblem& problem, const Effect& effect,
                                          Cause cause, const std::vector<Eigen::Index>& chosen,
                                          double surprise = 0);
/// A sine and a cosine of the angle of the cause's joint, of any order. Null where the joint hardly
/// moves.
[[nodiscard]] FamilyPtr make_order_family(const LinearProblem& problem, Cause cause);
/// A cause that begins at a pose; `effect` is that of the cause if it began before the first pose.
/// `spec` lacks its @pose.
[[nodiscard]] FamilyPtr make_step_family(const LinearProblem& problem, const Effect& effect,
                                         Cause cause, std::string spec);
/// One pose that does not belong.
[[nodiscard]] FamilyPtr make_pose_family(const LinearProblem& problem, Cause cause);
/// An angle error of the cause's joint that is a smooth function of that angle.
[[nodiscard]] FamilyPtr make_joint_map_family(const LinearProblem& problem, Cause cause);
/// A displacement of the tool in any of three axes, by a smooth function of one or two joints or,
/// if `joints` is empty, of the order in time.
[[nodiscard]] FamilyPtr make_anonymous_family(const LinearProblem& problem,
                                              const std::vector<int>& joints);

/// The circumstances of an error that follows the attitude of the tool.
inline constexpr const char* kAttitude = "attitude of the tool to gravity";
/// A displacement of the tool that depends on its attitude to gravity, such as sag in its clamp. No
/// named cause has this effect, but causes with many numbers fit a part of it.
[[nodiscard]] FamilyPtr make_attitude_family(const LinearProblem& problem);

/// An effect that moves slowly during the batch and may return: a smooth function of time for every
/// column of `columns` (R x m, whitened, per prior). It is the rival of effects that move at once,
/// or steadily. `wanderer`: the moving part, for people. `joint`: 0-based; -1: no single joint.
/// Null if no time passes.
[[nodiscard]] FamilyPtr make_slow_family(const LinearProblem& problem,
                                         const Eigen::MatrixXd& columns, std::string wanderer,
                                         int joint);

/// The lambda of every order of a joint and the orders, for its periodogram.
[[nodiscard]] Periodogram periodogram(const LinearProblem& problem, int joint,
                                      const Background& background);

}  // namespace trammel::cause_search
