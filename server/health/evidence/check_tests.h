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
  std::size_t causes = 0;  ///< how many of them are causes
};

/// The tests of a check, beside what is refitted.
class CheckTests {
 public:
  CheckTests(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& refitted,
             const Questions& questions);

  [[nodiscard]] const RefittedRows& rows() const { return rows_; }
  /// Numbers that the test of a hypothesis looks at.
  [[nodiscard]] int freedom(std::size_t hypothesis) const {
    return static_cast<int>(directions_[hypothesis].cols());
  }
  /// R x k, orthonormal: what each hypothesis can explain.
  [[nodiscard]] const std::vector<Eigen::MatrixXd>& directions() const { return directions_; }
  /// Chance of explaining as much of `left` (R, whitened, refitted) where nothing is.
  [[nodiscard]] double p_value(std::size_t hypothesis, const Eigen::VectorXd& left) const;
  /// The p-value of everything together.
  [[nodiscard]] double whole_p(const Eigen::VectorXd& left) const;
  /// The smallest of all causes and of the whole.
  [[nodiscard]] double smallest_p(const Eigen::VectorXd& left) const;
  /// The score of each hypothesis: what it explains, less Schwarz's price of its numbers.
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

/// The checks of healthy robots at these very poses: simulated ones, with the tails that the
/// model's own errors have, from which bad poses are taken out as from a real one.
class HealthyChecks {
 public:
  /// `frames`: R x f, refitted in any case. `tail_freedom`: of Student's t; 0: normal.
  HealthyChecks(const CheckRows& rows, Eigen::MatrixXd frames, const Questions& questions,
                int tail_freedom, std::uint64_t seed);

  /// Takes out poses while something is beyond chance and a single pose explains it best; at most a
  /// sixth of them.
  [[nodiscard]] Sifted sifted(const Eigen::VectorXd& residual);
  /// With these poses refitted as well, each by itself.
  [[nodiscard]] const CheckTests& tests(const std::vector<int>& bad);
  /// The p-value below which the smallest one of a healthy check is with this chance.
  [[nodiscard]] double limit(double false_alarm) const;
  /// Chance in a healthy check of a smallest p-value of at most `p`.
  [[nodiscard]] double chance_of(double p) const;

 private:
  using Seen = TestsBesidePoses::Seen;
  using Beside = TestsBesidePoses::Beside;
  [[nodiscard]] Eigen::VectorXd simulated(const Eigen::MatrixXd& root, std::uint64_t seed) const;
  /// The tests beside these poses. Valid until the next call: sets are kept only while they take
  /// little room.
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

/// Student's degrees of freedom of the errors of `poses` poses whose 99.7 % quantile is so many
/// times their rms; 0: they are normal, or too few to say.
[[nodiscard]] int tail_freedom_of(double p997_over_rms, int poses);

}  // namespace trammel::health
