#include "clients/cam/taught.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel::cam {

namespace {

constexpr std::size_t kFewestPositions = 4;  // poses that show a habit
constexpr std::size_t kMost = 500;           // nobody jogs to more
constexpr double kStep = 0.5;                // mm: coordinates of drawn targets are multiples of it
constexpr double kSame = 1e-4;               // mm: below any written digit
constexpr double kSameRotation = 5e-5;       // rad: a jogged wrist comes back to 1e-4 at best
constexpr double kNearest = 20;     // mm: paths of CAM systems have their points closer together
constexpr std::size_t kTenth = 10;  // share of the poses, or one pose, that may look drawn by
                                    // chance

bool is_plain(double mm) { return std::abs(mm - kStep * std::round(mm / kStep)) < kSame; }

/// An axis of the tool lies along one of the frame: nobody jogs that exactly.
bool is_aligned(const Pose& X) {
  return X.linear().cwiseAbs().maxCoeff() > std::cos(kSameRotation);
}

bool share_a_number(const Pose& a, const Pose& b) {
  const Vector3 apart = ((a.translation() - b.translation()) * to_mm(1)).cwiseAbs();
  return apart.minCoeff() < kSame || pose_difference(a, b).tail<3>().norm() < kSameRotation;
}

bool looks_drawn(const std::vector<Pose>& poses, std::size_t k) {
  const Vector3 p = poses[k].translation() * to_mm(1);
  if (is_plain(p.x()) || is_plain(p.y()) || is_plain(p.z()) || is_aligned(poses[k])) return true;
  for (std::size_t other = 0; other < poses.size(); ++other) {
    if (other != k && share_a_number(poses[k], poses[other])) return true;
  }
  return false;
}

/// The median distance from a target to the next one, mm.
double usual_step(const std::vector<Pose>& poses) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < poses.size(); ++k)
    steps.push_back(to_mm((poses[k].translation() - poses[k - 1].translation()).norm()));
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace

std::string note_on_taught_targets(const Program& program) {
  std::vector<Pose> poses;
  for (const ProgramTarget& target : program.targets) {
    if (!is_joints(target.coordinates) && !target.folded)
      poses.push_back(pose_of(target.coordinates, target.numbers));
  }
  if (poses.size() < kFewestPositions || poses.size() > kMost || usual_step(poses) < kNearest)
    return "";
  std::size_t drawn = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) drawn += looks_drawn(poses, k) ? 1 : 0;
  if (drawn > std::max<std::size_t>(1, poses.size() / kTenth)) return "";
  return fmt::format(
      "{} of {} poses look taught: no number of them is round or stands twice. Taught positions "
      "hold the robot's errors already and get worse when they are corrected; correct only what "
      "was programmed off line",
      poses.size() - drawn, poses.size());
}

}  // namespace trammel::cam
