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
constexpr double kPlain = 1e-4;              // mm: below any written digit
constexpr double kAligned = 5e-5;            // rad: a jogged wrist comes back to 1e-4 at best
constexpr double kNearest = 20;     // mm: paths of CAM systems have their points closer together
constexpr std::size_t kTenth = 10;  // share of the poses, or one pose, that may look drawn by
                                    // chance
constexpr const char* kTaughtHoldErrors =
    "Taught positions hold the robot's errors already and get worse when they are corrected; "
    "correct only what was programmed off line";

/// What a program writes of a target, as far as it tells who made it.
struct Shape {
  Pose X;
  double same_mm = kPlain, same_rad = kAligned;  ///< two equal numbers: below their last digits
};

bool is_plain(double mm) { return std::abs(mm - kStep * std::round(mm / kStep)) < kPlain; }

/// Digits behind the point of the number with the fewest; of a UR waypoint 12, of its joints 14 to
/// 18, as they come from the encoders.
int fewest_decimals(const ProgramTarget& target) {
  int fewest = target.rewrites.empty() ? 0 : 99;
  for (const Rewrite& rewrite : target.rewrites)
    for (const Slot& slot : rewrite.slots) fewest = std::min(fewest, slot.style.decimals);
  return fewest;
}

/// A pendant writes all digits that it has. A way that was jogged along an axis keeps the other two
/// coordinates to picometres, not to the last digit, and the turn even to that: of such poses only
/// coordinates that are the same say that somebody wrote them.
Shape shape_of(const ProgramTarget& target) {
  constexpr int kAllDigits = 9;          // of metres and radians
  constexpr double kHalfADigit = 5e-13;  // m
  Shape shape{pose_of(target.coordinates, target.numbers)};
  if (target.coordinates == Coordinates::kRotationVector && fewest_decimals(target) >= kAllDigits) {
    shape.same_mm = to_mm(kHalfADigit);
    shape.same_rad = 0;
  }
  return shape;
}

/// Joints with all digits of which none is a round number of degrees: nobody writes these by hand.
bool are_read_from_encoders(const ProgramTarget& target) {
  constexpr int kAllDigits = 12;                 // rad
  constexpr double kRound = 0.01, kSame = 1e-7;  // deg
  if (target.coordinates != Coordinates::kJointRadians || fewest_decimals(target) < kAllDigits)
    return false;
  return std::none_of(target.numbers.begin(), target.numbers.end(), [&](double rad) {
    const double deg = to_deg(rad);
    return std::abs(deg - kRound * std::round(deg / kRound)) < kSame;
  });
}

double apart_deg(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k)
    most = std::max(most, std::abs(to_deg(a[k] - b[k])));
  return most;
}

/// An axis of the tool lies along one of the frame: nobody jogs that exactly.
bool is_aligned(const Pose& X) { return X.linear().cwiseAbs().maxCoeff() > std::cos(kAligned); }

bool share_a_number(const Shape& a, const Shape& b) {
  const Vector3 apart = ((a.X.translation() - b.X.translation()) * to_mm(1)).cwiseAbs();
  return apart.minCoeff() < std::min(a.same_mm, b.same_mm) ||
         pose_difference(a.X, b.X).tail<3>().norm() < std::min(a.same_rad, b.same_rad);
}

bool looks_drawn(const std::vector<Shape>& poses, std::size_t k) {
  const Vector3 p = poses[k].X.translation() * to_mm(1);
  if (is_plain(p.x()) || is_plain(p.y()) || is_plain(p.z()) || is_aligned(poses[k].X)) return true;
  for (std::size_t other = 0; other < poses.size(); ++other) {
    if (other != k && share_a_number(poses[k], poses[other])) return true;
  }
  return false;
}

/// The median distance from a target to the next one, mm.
double usual_step(const std::vector<Shape>& poses) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < poses.size(); ++k)
    steps.push_back(to_mm((poses[k].X.translation() - poses[k - 1].X.translation()).norm()));
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace

namespace {

/// Of joints alone: each is read from encoders, and the arm moves between them.
std::string note_on_taught_joints(const Program& program) {
  constexpr double kLeastStep = 2;  // deg
  std::vector<const std::vector<double>*> joints;
  std::size_t written = 0;
  for (const ProgramTarget& target : program.targets) {
    if (target.coordinates != Coordinates::kJointRadians) continue;
    ++written;
    if (are_read_from_encoders(target)) joints.push_back(&target.numbers);
  }
  if (joints.size() < kFewestPositions || joints.size() > kMost ||
      written - joints.size() > std::max<std::size_t>(1, written / kTenth))
    return "";
  std::size_t far = 0;
  for (std::size_t k = 1; k < joints.size(); ++k)
    far += apart_deg(*joints[k - 1], *joints[k]) >= kLeastStep ? 1 : 0;
  if (2 * far < joints.size() - 1) return "";
  return fmt::format(
      "{} of {} joint targets look taught: they have all digits of the encoders, and none is a "
      "round number of degrees. {}",
      joints.size(), written, kTaughtHoldErrors);
}

}  // namespace

std::string note_on_taught_targets(const Program& program) {
  std::vector<Shape> poses;
  for (const ProgramTarget& target : program.targets) {
    if (!is_joints(target.coordinates) && !target.folded) poses.push_back(shape_of(target));
  }
  if (poses.size() < kFewestPositions) return note_on_taught_joints(program);
  if (poses.size() > kMost || usual_step(poses) < kNearest) return "";
  std::size_t drawn = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) drawn += looks_drawn(poses, k) ? 1 : 0;
  if (drawn > std::max<std::size_t>(1, poses.size() / kTenth)) return "";
  return fmt::format("{} of {} poses look taught: no number of them is round or stands twice. {}",
                     poses.size() - drawn, poses.size(), kTaughtHoldErrors);
}

}  // namespace trammel::cam
