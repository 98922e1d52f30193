#include "clients/cam/program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "clients/cam/encoding.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

double near_turn(double angle, double like) {
  return angle + 360 * std::round((like - angle) / 360);
}

/// The nearer to `like` of the two angle triples of a rotation. If the middle angle is ±90 deg,
/// only a sum of the other two is determined: the first one stays.
Eigen::Vector3d nearest_zyx(const Matrix3& R, const Eigen::Vector3d& like) {
  Eigen::Vector3d one = to_deg(1.0) * zyx_angles(R);
  if (is_beta_upright(R)) {
    one(0) = like(0);
    one(2) = to_deg(R(2, 0) < 0 ? std::atan2(R(0, 1), R(1, 1)) : std::atan2(-R(0, 1), R(1, 1)));
    one(2) += R(2, 0) < 0 ? like(0) : -like(0);
  }
  Eigen::Vector3d other(one(0) + 180, 180 - one(1), one(2) + 180);
  for (Eigen::Index i = 0; i < 3; ++i) {
    one(i) = near_turn(one(i), like(i));
    other(i) = near_turn(other(i), like(i));
  }
  return (one - like).norm() <= (other - like).norm() ? one : other;
}

Matrix3 rotation_zyx(double z, double y, double x) {
  return pose_zyx(Vector3::Zero(), from_deg(z), from_deg(y), from_deg(x)).linear();
}

Vector3 vector_of(const std::vector<double>& numbers, std::size_t first) {
  return {numbers[first], numbers[first + 1], numbers[first + 2]};
}

/// The rotation vector, of the same rotation, nearest to `like`.
Vector3 nearest_rotation_vector(const Matrix3& R, const Vector3& like) {
  const Vector3 w = rotation_log(R);
  const double angle = w.norm();
  if (angle < 1e-9) return like.norm() > kPi ? Vector3(like.normalized() * 2 * kPi) : w;
  Vector3 best = w;
  for (const double turns : {-1.0, 1.0}) {
    const Vector3 candidate = w * ((angle + 2 * kPi * turns) / angle);
    if ((candidate - like).norm() < (best - like).norm()) best = candidate;
  }
  return best;
}

}  // namespace

bool is_joints(Coordinates coordinates) {
  return coordinates == Coordinates::kJoints || coordinates == Coordinates::kJointRadians ||
         coordinates == Coordinates::kJointPulses;
}

std::string pose_text(const Pose& X) {
  const Vector3 p = X.translation() * to_mm(1);
  const Eigen::Quaterniond q(X.linear());
  return fmt::format("[{:.3f}, {:.3f}, {:.3f}] mm [{:.6f}, {:.6f}, {:.6f}, {:.6f}]", p.x(), p.y(),
                     p.z(), q.w(), q.x(), q.y(), q.z());
}

std::string apart_text(const Pose& a, const Pose& b) {
  return fmt::format("{:.3f} mm and {:.4f} deg apart",
                     to_mm((a.translation() - b.translation()).norm()),
                     to_deg(pose_difference(a, b).tail<3>().norm()));
}

bool same_place(const Pose& a, const Pose& b) {
  constexpr double kSamePlace = 1e-5;  // m
  constexpr double kSameTurn = 9e-5;   // rad, 0.005 deg
  return (a.translation() - b.translation()).norm() <= kSamePlace &&
         pose_difference(a, b).tail<3>().norm() <= kSameTurn;
}

std::string against_row(const std::string& row, const Pose& X, const Pose& by_files,
                        const std::string& place) {
  if (same_place(X, by_files)) return "";
  return fmt::format("{} is {} by --frames and {} by {}: {}", row, pose_text(X),
                     pose_text(by_files), place, apart_text(X, by_files));
}

bool take_row(const std::string& row, const ReadOptions& options, ProgramTool& tool) {
  tool.row = row;
  const auto given = options.frames.find(row);
  tool.from_row = given != options.frames.end();
  if (tool.from_row) tool.X_FT = given->second;
  return tool.from_row;
}

bool take_row(const std::string& row, const ReadOptions& options, ProgramFrame& frame) {
  frame.row = row;
  const auto given = options.frames.find(row);
  frame.in_base = given != options.frames.end();
  if (frame.in_base) frame.X_BO = given->second;
  return frame.in_base;
}

FramesRows rows_of(const Program& program) {
  FramesRows rows;
  for (const ProgramTool& tool : program.tools) {
    if (!tool.row.empty()) (tool.X_FT ? rows.used : rows.open).insert(tool.row);
  }
  for (const ProgramFrame& frame : program.frames) {
    if (!frame.row.empty())
      (frame.why_not.empty() || frame.in_base ? rows.used : rows.open).insert(frame.row);
  }
  rows.used.insert(kRobotBase);
  return rows;
}

std::size_t add_once(Program& program, ProgramTool tool) {
  for (std::size_t k = 0; k < program.tools.size(); ++k) {
    const ProgramTool& known = program.tools[k];
    if (known.name == tool.name && known.file == tool.file && known.line == tool.line &&
        known.carries == tool.carries && known.why_not == tool.why_not)
      return k;
  }
  program.tools.push_back(std::move(tool));
  return program.tools.size() - 1;
}

std::size_t add_once(Program& program, ProgramFrame frame) {
  for (std::size_t k = 0; k < program.frames.size(); ++k) {
    const ProgramFrame& known = program.frames[k];
    if (lower(known.name) == lower(frame.name) && known.why_not == frame.why_not &&
        known.X_BO.isApprox(frame.X_BO, 1e-12))
      return k;
  }
  program.frames.push_back(std::move(frame));
  return program.frames.size() - 1;
}

std::string called(const ProgramTool& tool) {
  return tool.carries.empty()
             ? shown(tool.name)
             : fmt::format("{} carrying {}", shown(tool.name), shown(tool.carries));
}

namespace {

/// Removes the targets marked in `leave`; motions go to the others.
void remove_targets(Program& program, const std::vector<bool>& leave) {
  std::vector<std::size_t> now(program.targets.size());
  std::vector<ProgramTarget> kept;
  for (std::size_t t = 0; t < program.targets.size(); ++t) {
    now[t] = kept.size();
    if (!leave[t]) kept.push_back(std::move(program.targets[t]));
  }
  program.targets = std::move(kept);
  for (ProgramMove& move : program.moves) {
    std::erase_if(move.targets, [&](std::size_t t) { return leave[t]; });
    for (std::size_t& t : move.targets) t = now[t];
  }
}

/// True if one of the motions [first, end) of an arc is left.
bool arc_is_left(const Program& program, const std::vector<bool>& leave, std::size_t first,
                 std::size_t end) {
  return std::any_of(
      program.moves.begin() + static_cast<std::ptrdiff_t>(first),
      program.moves.begin() + static_cast<std::ptrdiff_t>(end), [&](const ProgramMove& move) {
        return move.left_some || std::any_of(move.targets.begin(), move.targets.end(),
                                             [&](std::size_t t) { return leave[t]; });
      });
}

}  // namespace

void leave_targets_in(Program& program, const std::set<std::string>& files) {
  std::vector<bool> leave(program.targets.size(), false);
  std::set<std::string> unused;
  for (std::size_t t = 0; t < program.targets.size(); ++t) {
    const ProgramTarget& target = program.targets[t];
    const std::string& file = program.files[target.file].name;
    if (!files.contains(file)) continue;
    leave[t] = true;
    if (target.used_at.empty()) {
      unused.insert(file);
      continue;
    }
    const bool home = program.dialect == "krl" && is_joints(target.coordinates);
    program.left.push_back({target.name, target.file, target.line, target.motion,
                            fmt::format("it {} a system file of the controller, which a run over a "
                                        "folder leaves as it is; hand that file over by its name "
                                        "to have it corrected",
                                        home ? "is a home position, joints in" : "stands in")});
  }
  if (std::find(leave.begin(), leave.end(), true) == leave.end()) return;
  for (ProgramMove& move : program.moves)
    move.left_some = move.left_some || std::any_of(move.targets.begin(), move.targets.end(),
                                                   [&](std::size_t t) { return leave[t]; });
  for (const std::string& file : unused)
    program.notes.push_back(fmt::format(
        "positions in {}, a system file of the controller, are left as they are", file));
  remove_targets(program, leave);
}

void leave_halves_of_arcs(Program& program) {
  std::vector<bool> leave(program.targets.size(), false);
  bool any = false;
  const auto leave_all = [&](ProgramMove& move, const ProgramMove& arc) {
    move.left_some = true;
    bool more = false;
    for (const std::size_t t : move.targets) {
      if (leave[t]) continue;
      leave[t] = more = any = true;
      const ProgramTarget& target = program.targets[t];
      program.left.push_back({target.name, target.file, target.line, target.motion,
                              fmt::format("the other point of its arc ({} line {}) is left",
                                          program.files[arc.file].name, arc.line)});
    }
    return more;
  };
  for (bool more = true; more;) {
    more = false;
    std::size_t end = 0;
    for (std::size_t first = 0; first < program.moves.size(); first = end) {
      end = first + 1;
      while (end < program.moves.size() && program.moves[end].arc_goes_on) ++end;
      const ProgramMove& arc = program.moves[first];
      if (!arc_is_left(program, leave, first, end)) continue;
      for (std::size_t m = first; m < end; ++m) {
        if (arc.is_arc)
          more |= leave_all(program.moves[m], arc);
        else
          program.moves[m].left_some = true;
      }
    }
  }
  if (any) remove_targets(program, leave);
}

bool carries_robot(const Program& program, int axis) {
  return program.dialect == "inform" && axis >= kFirstBaseAxis && axis < kFirstStationAxis;
}

std::string axis_called(const Program& program, int axis) {
  const int of_six = axis % 6 + 1;
  if (program.dialect == "fanuc")
    return axis < 6 ? fmt::format("axis E{}", of_six)
                    : fmt::format("group {}, axis {}", axis / 6 + 1, of_six);
  if (program.dialect == "inform")
    return fmt::format("{} axis {}", axis < kFirstStationAxis ? "base" : "station", of_six);
  return fmt::format("external axis {}", static_cast<char>('a' + axis));
}

Status take_idle_axes(Program& program, const std::vector<std::string>& names) {
  std::map<std::string, int> known;
  for (const ProgramTarget& target : program.targets) {
    for (const auto& [axis, value] : target.external)
      known.emplace(axis_called(program, axis), axis);
  }
  for (const int axis : program.moved_axes) known.emplace(axis_called(program, axis), axis);
  for (const std::string& name : names) {
    const auto axis = known.find(name);
    if (axis == known.end()) {
      std::vector<std::string> all;
      for (const auto& [called, number] : known) all.push_back("'" + called + "'");
      return failure(ErrorCode::kUsage, "the program has no axis '{}'", shown(name))
          .of("--idle-axis")
          .with_text(name)
          .next(all.empty() ? "its targets have no external axes"
                            : fmt::format("it has {}", fmt::join(all, ", ")));
    }
    program.moved_axes.erase(axis->second);
    for (ProgramTarget& target : program.targets) target.external.erase(axis->second);
  }
  return {};
}

int line_of(const std::string& text, std::size_t at) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(at, text.size()));
  return 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
}

std::size_t line_begin(const std::string& text, std::size_t at) {
  const std::size_t end = at == 0 ? std::string::npos : text.rfind('\n', at - 1);
  return end == std::string::npos ? 0 : end + 1;
}

Status check_files(const Program& program) {
  for (const SourceFile& file : program.files) {
    if (encoding_of(file.text) != Encoding::kBytes)
      return refused("text in UTF-16, expected UTF-8").in(file.name).next("save it as UTF-8");
    if (file.text.find('\r') == std::string::npos || file.text.find('\n') != std::string::npos)
      continue;
    return refused("its lines end in CR alone")
        .in(file.name)
        .next("save it with line ends LF or CR LF");
  }
  if (program.cuts.empty()) return {};
  const Cut& cut = program.cuts.front();
  return refused("{}: the file is not whole", cut.what)
      .in(program.files[cut.file].name)
      .at_row(cut.line)
      .next("fetch it from the controller again");
}

Pose pose_of(Coordinates coordinates, const std::vector<double>& numbers) {
  const Vector3 p = vector_of(numbers, 0);
  switch (coordinates) {
    case Coordinates::kQuaternion: {
      const Eigen::Quaterniond R(numbers[3], numbers[4], numbers[5], numbers[6]);
      return make_pose(R.normalized().toRotationMatrix(), p * from_mm(1));
    }
    case Coordinates::kAnglesZyx:
      return make_pose(rotation_zyx(numbers[3], numbers[4], numbers[5]), p * from_mm(1));
    case Coordinates::kAnglesXyz:
      return make_pose(rotation_zyx(numbers[5], numbers[4], numbers[3]), p * from_mm(1));
    case Coordinates::kRotationVector:
      return make_pose(rotation_exp(vector_of(numbers, 3)), p);
    case Coordinates::kJoints:
    case Coordinates::kJointRadians:
    case Coordinates::kJointPulses:
      break;
  }
  return Pose::Identity();
}

std::vector<double> numbers_of(Coordinates coordinates, const Pose& pose,
                               const std::vector<double>& like) {
  const Vector3 p = coordinates == Coordinates::kRotationVector
                        ? pose.translation().eval()
                        : (pose.translation() * to_mm(1)).eval();
  std::vector<double> numbers = {p.x(), p.y(), p.z()};
  switch (coordinates) {
    case Coordinates::kQuaternion: {
      Eigen::Quaterniond R(pose.linear());
      if (R.dot(Eigen::Quaterniond(like[3], like[4], like[5], like[6])) < 0) R.coeffs() *= -1;
      numbers.insert(numbers.end(), {R.w(), R.x(), R.y(), R.z()});
      return numbers;
    }
    case Coordinates::kAnglesZyx: {
      const Eigen::Vector3d a = nearest_zyx(pose.linear(), vector_of(like, 3));
      numbers.insert(numbers.end(), {a(0), a(1), a(2)});
      return numbers;
    }
    case Coordinates::kAnglesXyz: {
      const Eigen::Vector3d a = nearest_zyx(pose.linear(), {like[5], like[4], like[3]});
      numbers.insert(numbers.end(), {a(2), a(1), a(0)});
      return numbers;
    }
    case Coordinates::kRotationVector: {
      const Vector3 w = nearest_rotation_vector(pose.linear(), vector_of(like, 3));
      numbers.insert(numbers.end(), {w.x(), w.y(), w.z()});
      return numbers;
    }
    case Coordinates::kJoints:
    case Coordinates::kJointRadians:
    case Coordinates::kJointPulses:
      break;
  }
  return like;
}

}  // namespace trammel::cam
