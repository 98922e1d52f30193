#pragma once

#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/effect.h"

/// The bounds of a cause's numbers (Parameter::lower) are part of its meaning. Friction that takes
/// a joint too far, or a gear that lifts its load, is another cause, however well it fits. Play has
/// a rule of its own (play_sign.h).
namespace trammel::cause_search {

/// A cause whose numbers came out beyond their bounds.
struct WrongSign {
  Cause cause;
  std::vector<Estimate> numbers;        ///< those beyond their bounds, each beyond chance by itself
  std::vector<std::string> depends_on;  ///< quantities that change the effect: `q2`, `dir2`,
                                        ///< `torque`
  double strength = 0;                  ///< of all numbers, unrestricted
  double lost = 0;                      ///< the part of its strength that is lost within the bounds

  /// More numbers, or larger ones, are beyond their bounds than chance and the shape of real causes
  /// make.
  [[nodiscard]] bool is_beyond_chance() const;
  /// Most of the explained effect needs numbers that the cause cannot have.
  [[nodiscard]] bool is_another_cause() const;
};

/// The numbers of the cause that the model has as `source`, against their bounds. `change`,
/// `covariance`: the joint estimate of all parameters about where the model stands, in units of
/// priors.
[[nodiscard]] WrongSign wrong_sign_of(const LinearProblem& problem, const std::string& source,
                                      const Cause& cause, const Eigen::VectorXd& change,
                                      const Eigen::MatrixXd& covariance);

/// For people: which cause it looks like, and why it is not that.
[[nodiscard]] std::string what_wrong_sign_means(const WrongSign& wrong);

}  // namespace trammel::cause_search
