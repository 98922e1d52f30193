#pragma once

#include <vector>

#include "server/health/evidence/check_rows.h"

/// Zeros that several joints lost at once, as in a robot that was mastered anew, perhaps together
/// with a displaced tool: one explanation of a check.
///
/// A zero that is off by degrees does not act linearly, so base, zeros and tool are found together
/// by Gauss-Newton steps. Each number has a prior width, its largest credible value, which bounds
/// undetermined numbers.
namespace trammel::health {

/// One set of zeros, with or without the tool, as the poses have it.
struct ZerosFit {
  std::vector<std::size_t> zeros;  ///< indices in CauseEffects::causes(), ascending
  bool tool = false;               ///< sits elsewhere as well
  std::vector<int> bad = {};       ///< poses that do not count
  int numbers = 0;                 ///< free numbers that show at the poses
  double left = 0;                 ///< whitened square of the unexplained part
  Pose X_BB = Pose::Identity();    ///< the base, relative to the base of the rows

  std::vector<Eigen::Index> columns;  ///< of the numbers: zeros, then tool
  Eigen::VectorXd at;                 ///< K, in prior scales; 0 where `columns` are not
  Eigen::MatrixXd covariance;         ///< of `columns`
};

class ZerosSearch {
 public:
  /// `zeros`: causes that may be among them. `new_tool`: the tool is refitted in any case.
  ZerosSearch(const CauseEffects& effects, const CheckRows& rows, std::vector<std::size_t> zeros,
              bool new_tool);

  [[nodiscard]] const std::vector<std::size_t>& causes() const { return zeros_; }
  /// Each set of zeros, without and with the tool, and the tool alone. Empty for arms with too many
  /// joints. `bad`: poses that do not count.
  [[nodiscard]] std::vector<ZerosFit> all(const std::vector<int>& bad = {}) const;
  /// The check's rows, linearised at the fit, with its effects included.
  [[nodiscard]] CheckRows around(const ZerosFit& fit) const;

 private:
  struct Linear {
    Eigen::VectorXd residual;
    Eigen::MatrixXd by_base, by_cause;
  };
  /// `warmth`: adds the effect of warmth, which no zero needs.
  [[nodiscard]] Linear linear(const Eigen::VectorXd& at, const Pose& X_BB, bool warmth) const;
  [[nodiscard]] ZerosFit begun(unsigned chosen, bool tool, const std::vector<int>& bad) const;
  /// R x m: whitened columns that free these poses.
  [[nodiscard]] Eigen::MatrixXd freeing(const std::vector<int>& bad) const;
  void fit(ZerosFit& one) const;

  const CauseEffects& effects_;
  const CheckRows& rows_;
  const std::vector<std::size_t> zeros_;
  const bool new_tool_;
  const Eigen::LLT<Eigen::MatrixXd> factor_;
  std::vector<Pose> physics_;  // X_BT of the model's physics, at each pose
  int tool_numbers_ = 0;
};

}  // namespace trammel::health
