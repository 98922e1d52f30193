#include "server/compensate/paired_gain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/base/units.h"

namespace trammel {

namespace {

/// The statistic of ranks; 0 if all differences are zero or one is not finite.
double signed_rank_z(const Eigen::VectorXd& differences) {
  if (!differences.allFinite()) return 0;
  std::vector<double> d;
  std::copy_if(differences.begin(), differences.end(), std::back_inserter(d),
               [](double one) { return one != 0; });
  std::sort(d.begin(), d.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  double sum = 0;
  for (std::size_t first = 0, last = 0; first < d.size(); first = last) {
    while (last < d.size() && std::abs(d[last]) == std::abs(d[first])) ++last;
    const double rank = 0.5 * static_cast<double>(first + 1 + last);
    for (std::size_t i = first; i < last; ++i) sum += std::copysign(rank, d[i]);
  }
  // The variance of ranks without ties. The variance of mean ranks would be smaller, and nine equal
  // differences would pass in 2 of 100 cases.
  const auto n = static_cast<double>(d.size());
  return d.empty() ? 0 : sum / std::sqrt(n * (n + 1) * (2 * n + 1) / 6);
}

double sum_z(const Eigen::VectorXd& differences) {
  const double size = differences.norm();
  return differences.allFinite() && size > 0 ? differences.sum() / size : 0;
}

std::string verdict(const PairedGain& gain) {
  if (gain.beyond_chance()) return "better beyond chance";
  if (gain.z() > PairedGain::kBeyondChance) return "better at most poses, but much worse at others";
  return "not better beyond chance";
}

}  // namespace

PairedGain paired_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after,
                       const std::vector<PoseGroup>& poses) {
  const Eigen::VectorXd square_before = before.colwise().squaredNorm();
  const Eigen::VectorXd square_after = after.colwise().squaredNorm();
  Eigen::VectorXd less(std::ssize(poses));
  for (std::size_t p = 0; p < poses.size(); ++p)
    less(static_cast<Eigen::Index>(p)) = (square_before - square_after)(poses[p]).sum();
  PairedGain gain;
  gain.poses = static_cast<int>(poses.size());
  gain.rms_before = std::sqrt(square_before.mean());
  gain.rms_after = std::sqrt(square_after.mean());
  gain.z_ranks = signed_rank_z(less);
  gain.z_sum = sum_z(less);
  return gain;
}

PairedGain paired_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after) {
  std::vector<PoseGroup> poses;
  for (Eigen::Index i = 0; i < before.cols(); ++i) poses.push_back({i});
  return paired_gain(before, after, poses);
}

std::string to_string(const PairedGain& gain) {
  return fmt::format(
      "{:.4f} mm rms, before {:.4f} mm on the same {} poses held out: {} (z {:.2f}, limit "
      "{:.2f}){}",
      to_mm(gain.rms_after), to_mm(gain.rms_before), gain.poses, verdict(gain), gain.z(),
      PairedGain::kBeyondChance, judged_without(gain.left_out));
}

std::string judged_without(const std::vector<std::string>& poses) {
  if (poses.empty()) return "";
  return fmt::format("; judged without {}, which {} neither model", fmt::join(poses, ", "),
                     poses.size() > 1 ? "fit" : "fits");
}

}  // namespace trammel
