#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/measurement/pose_groups.h"

namespace trammel {

/// The errors of two models on the same poses, compared pose by pose.
///
/// d is the difference of a pose's squared errors, summed over its rows: several reflectors share
/// the error of the arm. Were the models equally good, each d would be as likely to have the other
/// sign. Two statistics test this; both are about standard normal then.
/// - Of ranks: W / sqrt(n (n + 1) (2n + 1) / 6), where W is the signed sum of the ranks of |d|,
///   with ties at their mean rank and zeros left out (Wilcoxon, Individual comparisons by ranking
///   methods, Biometrics Bulletin 1, 1945). A few poses with large errors cannot decide it alone.
/// - Of the sum: sum(d) / sqrt(sum(d²)) (Efron, Student's t-test under symmetry conditions, JASA
/// 64, 1969). It sees a cause
///   that acts at a few poses only.
/// Either may pass, each at half the chance. With fewer than seven poses neither does.
struct PairedGain {
  int poses = 0;
  double rms_before = 0, rms_after = 0;  ///< m, Euclidean
  double z_ranks = 0, z_sum = 0;
  std::vector<std::string> left_out;  ///< ids of poses that fit neither model and do not judge

  [[nodiscard]] double z() const { return z_ranks > z_sum ? z_ranks : z_sum; }

  /// By chance alone, one of the two scores exceeds this in one of a hundred cases.
  static constexpr double kBeyondChance = 2.576;
  /// True if the gain is beyond chance and the rms does not rise, since smaller errors at most
  /// poses are no gain if others get much worse.
  [[nodiscard]] bool beyond_chance() const {
    return z() > kBeyondChance && rms_after <= rms_before;
  }
};

/// `before`, `after`: 3 x N, m, errors of the same rows; `poses` groups the rows by joint vector.
[[nodiscard]] PairedGain paired_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after,
                                     const std::vector<PoseGroup>& poses);
/// Each row is a pose.
[[nodiscard]] PairedGain paired_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after);
/// `0.0210 mm rms, before 0.0250 mm on the same 30 poses held out: better beyond chance (z 4.10,
/// limit 2.58); judged without p7, which fits neither model`. If only the rms contradicts: `better
/// at most poses, but much worse at others (...)`.
[[nodiscard]] std::string to_string(const PairedGain& gain);
/// `; judged without p7, which fits neither model`; empty where there are none.
[[nodiscard]] std::string judged_without(const std::vector<std::string>& poses);

}  // namespace trammel
