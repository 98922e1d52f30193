#include "server/trainer/paired_gain.h"

#include <cmath>

#include "server/base/units.h"

namespace trammel {

PairedGain paired_gain(const Eigen::Matrix3Xd& before, const Eigen::Matrix3Xd& after) {
  const Eigen::VectorXd square_before = before.colwise().squaredNorm();
  const Eigen::VectorXd square_after = after.colwise().squaredNorm();
  const Eigen::VectorXd less = square_before - square_after;
  const double size = less.norm();
  PairedGain gain;
  gain.poses = static_cast<int>(less.size());
  gain.rms_before = std::sqrt(square_before.mean());
  gain.rms_after = std::sqrt(square_after.mean());
  gain.z = size > 0 ? less.sum() / size : 0;
  return gain;
}

PairedGain paired_gain(const CompensatedModel& before, const CompensatedModel& after, const MeasurementBatch& batch) {
  return paired_gain(before.errors_B(batch).compensated, after.errors_B(batch).compensated);
}

std::string to_string(const PairedGain& gain) {
  return fmt::format("{:.4f} mm rms, before {:.4f} mm on the same {} poses held out: {} (z {:.2f}, limit {:.2f}){}",
                     to_mm(gain.rms_after), to_mm(gain.rms_before), gain.poses,
                     gain.beyond_chance() ? "better beyond chance" : "not better beyond chance", gain.z,
                     PairedGain::kBeyondChance, judged_without(gain.left_out));
}

std::string judged_without(const std::vector<std::string>& poses) {
  if (poses.empty()) return "";
  return fmt::format("; judged without {}, which {} neither model", fmt::join(poses, ", "),
                     poses.size() > 1 ? "fit" : "fits");
}

}  // namespace trammel
