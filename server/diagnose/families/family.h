#pragma once

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

/// Candidates for what a model lacks: groups of whitened columns. A family is one cause (of one
/// joint), with whatever must be searched for within it: an order, the pose at which it begins, a
/// length scale.
namespace trammel::cause_search {

/// The member of a family that explains a data vector best. A family has at most one of order, pose
/// and length scale.
struct Best {
  double evidence =
      0;  ///< nat: log marginal likelihood against none of it, its size chosen by the data
  double strength = 0;           ///< squared whitened size of what it explains
  int freedom = 0;               ///< how many numbers it needs for that
  double order = 0;              ///< of a gear: cycles a joint turn; 0: none yet
  Eigen::Index pose = 0;         ///< place in the batch at which it begins, or that is out
  std::size_t length_scale = 0;  ///< of a smooth function: which of those that its family knows
  double size = 1;               ///< of a smooth function: its standard deviation, SI
};

/// A scan summed up pose by pose, for columns g(row) f(pose) of which only the function f of the
/// pose differs.
struct Shares {
  Eigen::MatrixXd along;   ///< N x k: g's rows of each pose times those of the projected data
  Eigen::MatrixXd root;    ///< N x p: the same with the background's root
  Eigen::VectorXd square;  ///< N: g's own
};
/// Those of the columns g that several families have, by what they are called.
using KnownShares = std::map<std::string, Shares>;

/// The rows as one scan sees them, with one set of data.
struct View {
  const Background& background;  ///< with zeros in the rows that are left out
  const Eigen::VectorXd* keep =
      nullptr;  ///< R: 1 for a row that is scanned, 0 for one that is left out; null: all
  std::shared_ptr<KnownShares> known = std::make_shared<KnownShares>();
};

/// `name`: what `g` is called; the same is summed up once a view.
[[nodiscard]] const Shares& shares_of(const LinearProblem& problem, const View& view,
                                      const std::string& name, const Eigen::VectorXd& g,
                                      const Eigen::MatrixXd& projected);

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
  /// As a cell file spells it; empty where no error source describes it.
  [[nodiscard]] virtual std::string source(const Best&) const { return {}; }
  /// False: a function of some joints that no physics stands behind.
  [[nodiscard]] virtual bool named() const { return true; }
  /// The circumstances that an anonymous family depends on: `q4`, `time`.
  [[nodiscard]] virtual std::vector<std::string> depends_on() const { return {}; }
  /// The thing that moves slowly, for people, where the family says no more than that: `the zero of
  /// joint 3`; else empty.
  [[nodiscard]] virtual std::string wanderer() const { return {}; }
  /// False where it says nothing of other poses.
  [[nodiscard]] virtual bool predicts() const { return true; }
  /// The name among the other families: the same on every background.
  [[nodiscard]] std::string label() const;
  /// nat: how much less it is to be expected than other causes.
  [[nodiscard]] virtual double surprise() const { return 0; }
  /// The best member for each column of `projected` (R x k: S⁻¹ y).
  [[nodiscard]] virtual std::vector<Best> scan(const View& view,
                                               const Eigen::MatrixXd& projected) const = 0;
  /// R x m: in units of priors (of the fitted size, where that is known).
  [[nodiscard]] virtual Eigen::MatrixXd columns(const Best& best) const = 0;
  /// A member to speak of where none was found.
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
/// A cause that begins at a pose; `effect` is that of one that began before the first. `spec`
/// without its @pose.
[[nodiscard]] FamilyPtr make_step_family(const LinearProblem& problem, const Effect& effect,
                                         Cause cause, std::string spec);
/// One pose that does not belong.
[[nodiscard]] FamilyPtr make_pose_family(const LinearProblem& problem, Cause cause);
/// An error of the angle of the cause's joint by a smooth function of that angle.
[[nodiscard]] FamilyPtr make_joint_map_family(const LinearProblem& problem, Cause cause);
/// A displacement of the tool, any in three axes, by a smooth function of the joints (one or two)
/// or, where `joints` is empty, of the order in time.
[[nodiscard]] FamilyPtr make_anonymous_family(const LinearProblem& problem,
                                              const std::vector<int>& joints);

/// The circumstances of an error that follows the attitude of the tool.
inline constexpr const char* kAttitude = "attitude of the tool to gravity";
/// A displacement of the tool that follows how it stands to gravity, as where it sags in its clamp.
/// No cause of the list does so, and causes of many numbers fit a part of it.
[[nodiscard]] FamilyPtr make_attitude_family(const LinearProblem& problem);

/// Something that moves slowly in the course of the batch, and may come back: a smooth function of
/// the time for every column of `columns` (R x m, whitened, per prior). It is the rival of what
/// moves at once, or steadily. `wanderer`: what that is, for people. `joint`: 0-based; -1: of no
/// single one. Null where no time goes by.
[[nodiscard]] FamilyPtr make_slow_family(const LinearProblem& problem,
                                         const Eigen::MatrixXd& columns, std::string wanderer,
                                         int joint);

/// The lambda of every order of a joint and the orders, for its periodogram.
[[nodiscard]] Periodogram periodogram(const LinearProblem& problem, int joint,
                                      const Background& background);

}  // namespace trammel::cause_search
