#include "clients/library/convert.h"

#include <cmath>

#include "server/base/units.h"
#include "server/exchange/si.h"

namespace trammel::library {

namespace {

constexpr double kUnitLength = 1e-3;   // accepted difference of a quaternion's length from 1, as in
                                       // files
constexpr double kHottest = 1000;      // degrees Celsius, either side of zero
constexpr double kFarthestMm = 1e6;    // of a position, as in files
constexpr double kLargestJoint = 1e6;  // deg, of a rail mm

bool is_rail(const Chain& robot, int joint) {
  return robot.joint(joint).type == JointType::kPrismatic;
}

/// The code of the same name. A new code of ours needs a line here: the compiler rejects a switch
/// without it.
constexpr api::ErrorCode same_code(trammel::ErrorCode code) {
  using trammel::ErrorCode;
  switch (code) {
    case ErrorCode::kUsage:
      return api::ErrorCode::kUsage;
    case ErrorCode::kRefused:
      return api::ErrorCode::kRefused;
    case ErrorCode::kNotFound:
      return api::ErrorCode::kNotFound;
    case ErrorCode::kConflict:
      return api::ErrorCode::kConflict;
    case ErrorCode::kTooLarge:
      return api::ErrorCode::kTooLarge;
    case ErrorCode::kBusy:
      return api::ErrorCode::kBusy;
    case ErrorCode::kUnreachable:
      return api::ErrorCode::kUnreachable;
    case ErrorCode::kInternal:
      return api::ErrorCode::kInternal;
  }
  return api::ErrorCode::kInternal;
}

/// True if each code of the library, cast to ours, is the one of the same name.
constexpr bool casts_keep_names() {
  for (int k = 0; k <= static_cast<int>(trammel::ErrorCode::kInternal); ++k)
    if (same_code(static_cast<trammel::ErrorCode>(k)) != static_cast<api::ErrorCode>(k))
      return false;
  return true;
}
static_assert(casts_keep_names());

Error at_index(Error error, std::size_t index) {
  return Failure(std::move(error)).at_row(static_cast<long>(index)).value();
}

}  // namespace

api::Error to_api(const Error& error) {
  api::Error out;
  out.code = same_code(error.code);
  out.message = error.message;
  out.file = error.file;
  out.row = error.row;
  out.field = error.field;
  out.value = error.value;
  out.limit = error.limit;
  out.text = error.text;
  out.next = error.next;
  for (const Error& other : error.also) out.also.push_back(to_api(other));
  out.sentence = sentence(error);
  return out;
}

std::vector<api::Note> to_api(const std::vector<Note>& notes) {
  std::vector<api::Note> all;
  all.reserve(notes.size());
  for (const Note& note : notes) all.push_back({note.code, to_text(note.severity), note.text});
  return all;
}

Result<Pose> from_api(const api::Pose& X_AB) {
  for (const double mm : X_AB.xyz_mm) {
    if (!(std::abs(mm) <= kFarthestMm))
      return refused("position is {} mm, limit {:.0f}", mm, kFarthestMm)
          .of("xyz_mm")
          .beyond(mm, kFarthestMm);
  }
  const Eigen::Quaterniond R(X_AB.q_wxyz[0], X_AB.q_wxyz[1], X_AB.q_wxyz[2], X_AB.q_wxyz[3]);
  if (!(std::abs(R.norm() - 1) <= kUnitLength)) {
    return refused("the quaternion has length {:.6g}, limit 1 +- {}", R.norm(), kUnitLength)
        .of("q_wxyz")
        .beyond(R.norm(), 1);
  }
  return exchange::to_si(X_AB);
}

Result<JointVector> joints_from_api(std::span<const double> joints_deg, const Chain& robot) {
  if (joints_deg.size() != static_cast<std::size_t>(robot.size())) {
    return failure(ErrorCode::kUsage, "{} joints, robot {} has {}", joints_deg.size(), robot.name(),
                   robot.size())
        .of("joints_deg")
        .beyond(joints_deg.size(), robot.size());
  }
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = joints_deg[static_cast<std::size_t>(j)];
    if (!(std::abs(value) <= kLargestJoint)) {
      return refused("joint {} is {}, limit {:.0f}", j + 1, value, kLargestJoint)
          .of("joints_deg")
          .beyond(value, kLargestJoint);
    }
    q(j) = is_rail(robot, j) ? from_mm(value) : from_deg(value);
  }
  return q;
}

Result<std::vector<JointVector>> all_joints_from_api(std::span<const double> joints_deg,
                                                     const Chain& robot) {
  const auto n = static_cast<std::size_t>(robot.size());
  if (joints_deg.size() % n != 0) {
    return failure(ErrorCode::kUsage,
                   "{} joint values, not a multiple of the {} joints of robot {}",
                   joints_deg.size(), n, robot.name())
        .of("joints_deg")
        .beyond(joints_deg.size(), n);
  }
  std::vector<JointVector> all;
  all.reserve(joints_deg.size() / n);
  for (std::size_t i = 0; i < joints_deg.size(); i += n) {
    Result<JointVector> q = joints_from_api(joints_deg.subspan(i, n), robot);
    if (!q) return tl::make_unexpected(at_index(q.error(), i / n));
    all.push_back(std::move(*q));
  }
  return all;
}

Status check_context(const api::Context& context, const Chain& robot) {
  const auto count = static_cast<int>(context.directions.size());
  if (count != 0 && count != robot.size()) {
    return failure(ErrorCode::kUsage, "{} directions, robot {} has {} joints", count, robot.name(),
                   robot.size())
        .of("directions")
        .beyond(count, robot.size());
  }
  for (const int direction : context.directions) {
    if (direction < -1 || direction > 1)
      return refused("direction is {}, not -1, 0 or 1", direction)
          .of("directions")
          .beyond(direction, 1);
  }
  if (context.temperature_c && !(std::abs(*context.temperature_c) <= kHottest)) {
    return refused("temperature is {} C, limit {:.0f}", *context.temperature_c, kHottest)
        .of("temperature_c")
        .beyond(*context.temperature_c, kHottest);
  }
  return {};
}

}  // namespace trammel::library

namespace trammel::api {

std::string to_text(ErrorCode code) {
  return trammel::to_text(static_cast<trammel::ErrorCode>(code));
}

}  // namespace trammel::api
