#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/health/evidence/refitted_rows.h"
#include "server/health/evidence/tests_beside_poses.h"

namespace trammel::health {

/// The hypotheses of a check: causes first, then single bad poses.
struct Questions {
  std::vector<Hypothesis> hypotheses;
  std::size_t causes = 0;  ///< the number of hypotheses that are causes
};

/// The tests of a check, with base and tool refitted.
class CheckTests {
 public:
  CheckTests(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& refitted,
             const Questions& questions);

  [[nodiscard]] const RefittedRows& rows() const { return rows_; }
  /// Numbers that the test of a hypothesis uses.
  [[nodiscard]] int freedom(std::size_t hypothesis) const {
    return static_cast<int>(directions_[hypothesis].cols());
  }
  /// R x k, orthonormal: the directions that each hypothesis can explain.
  [[nodiscard]] const std::vector<Eigen::MatrixXd>& directions() const { return directions_; }
  /// The chance that a healthy robot's residual is explained as well as `left` (R, whitened,
  /// refitted).
  [[nodiscard]] double p_value(std::size_t hypothesis, const Eigen::VectorXd& left) const;
  /// The p-value of everything together.
  [[nodiscard]] double whole_p(const Eigen::VectorXd& left) const;
  /// The smallest of all causes and of the whole.
  [[nodiscard]] double smallest_p(const Eigen::VectorXd& left) const;
  /// The score of each hypothesis: its gain less Schwarz's price of its numbers.
  [[nodiscard]] std::vector<double> scores(const Eigen::VectorXd& left) const;

 private:
  RefittedRows rows_;
  std::vector<Eigen::MatrixXd> directions_;
  std::size_t causes_;
};

/// A check without its bad poses.
struct Sifted {
  std::vector<int> bad;  ///< poses, as they were found
  double smallest_p = 1;
};

/// Simulated checks of healthy robots at these very poses, with the tails of the model's own
/// errors. Bad poses are removed from them as from a real check.
class HealthyChecks {
 public:
  /// `frames`: R x f, refitted in any case. `tail_freedom`: of Student's t; 0: normal.
  HealthyChecks(const CheckRows& rows, Eigen::MatrixXd frames, const Questions& questions,
                int tail_freedom, std::uint64_t seed);

  /// Removes poses while the residual is beyond chance and a single pose explains it best; at most
  /// a sixth of them.
  [[nodiscard]] Sifted sifted(const Eigen::VectorXd& residual);
  /// The tests with these poses refitted as well, each by itself.
  [[nodiscard]] const CheckTests& tests(const std::vector<int>& bad);
  /// The p-value that the smallest one of a healthy check is below with this chance.
  [[nodiscard]] double limit(double false_alarm) const;
  /// Chance in a healthy check of a smallest p-value of at most `p`.
  [[nodiscard]] double chance_of(double p) const;

 private:
  using Seen = TestsBesidePoses::Seen;
  using Beside = TestsBesidePoses::Beside;
  [[nodiscard]] Eigen::VectorXd simulated(const Eigen::MatrixXd& root, std::uint64_t seed) const;
  /// The tests beside these poses. The reference is valid until the next call, because the sets are
  /// kept only while they need little memory.
  [[nodiscard]] const Beside& beside(std::vector<int> bad);
  [[nodiscard]] double smallest_p(const Beside& beside, const Seen& left) const;
  [[nodiscard]] std::size_t most_explained(const Beside& beside, const Seen& left) const;

  const CheckRows& rows_;
  const Eigen::MatrixXd frames_;
  const Questions& questions_;
  const int tail_freedom_;
  std::map<std::vector<int>, CheckTests> tests_;
  const TestsBesidePoses beside_poses_;
  std::map<std::vector<int>, Beside> beside_;
  std::size_t held_ = 0;  // numbers in `beside_`
  std::optional<Beside> passing_;
  std::vector<double> smallest_;  // p-values of simulated checks, rising
};

/// Student's degrees of freedom for the errors of `poses` poses, from their 99.7 % quantile over
/// their rms; 0: they are normal, or too few.
[[nodiscard]] int tail_freedom_of(double p997_over_rms, int poses);

}  // namespace trammel::health
