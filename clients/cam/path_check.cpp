#include "clients/cam/path_check.h"

#include <fmt/format.h>

#include <cmath>

#include "server/base/units.h"

namespace trammel::cam {

namespace {

constexpr double kLeastWay = 1e-6;      // m: a motion that only turns has no speed along its path
constexpr double kNoticeableMm = 1e-3;  // a step that is worth telling, mm

/// rad, m.
JointVector joints_of(const ReceiptRow& row, const Chain& robot, const JointVector& nominal) {
  if (row.joints.empty()) return nominal;
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = row.joints[static_cast<std::size_t>(j)];
    q(j) = robot.joint(j).type == JointType::kRevolute ? from_deg(value) : from_mm(value);
  }
  return q;
}

struct SpeedLimit {
  double mm_s = kNotKnown;
  int joint = -1;  ///< the joint that reaches its limit first
};

SpeedLimit speed_limit(const Chain& robot, const JointVector& from, const JointVector& to,
                       double way) {
  SpeedLimit least;
  for (int j = 0; j < robot.size(); ++j) {
    const double turn = std::abs(to(j) - from(j));
    if (!robot.joint(j).max_speed || turn == 0) continue;
    const double limit = to_mm(way * *robot.joint(j).max_speed / turn);
    if (least.joint < 0 || limit < least.mm_s) least = {limit, j};
  }
  return least;
}

class Path {
 public:
  Path(const Program& program, const Chain& robot, const NominalTargets& nominal,
       std::vector<ReceiptRow>& rows, CorrectedProgram& result)
      : program_(program), robot_(robot), nominal_(nominal), rows_(rows), result_(result) {}

  void check() {
    const ProgramMove* last = nullptr;
    const std::size_t* before = nullptr;
    for (const ProgramMove& move : program_.moves) {
      if (last != nullptr && last->file != move.file) before = nullptr;
      last = &move;
      // An arc has two targets. More targets are elements of an array, and a variable selects one.
      if (move.targets.empty() || move.targets.size() > 2) {
        before = nullptr;
        continue;
      }
      for (const std::size_t& t : move.targets) {
        if (before != nullptr && program_.targets[t].linear) step(*before, t, move);
        before = &t;
      }
    }
    if (too_fast_ > 0) {
      result_.notes.push_back(
          fmt::format("{} motions would turn an axis faster than it can, which they did not before",
                      too_fast_));
    }
    if (result_.largest_step_mm > kNoticeableMm && left_beside_) {
      result_.notes.push_back(fmt::format(
          "a target that is left stands beside corrected ones on a straight path: a step of {:.3f} "
          "mm at {} line {}",
          result_.largest_step_mm, result_.largest_step_file, result_.largest_step_line));
    }
  }

 private:
  void step(std::size_t from, std::size_t to, const ProgramMove& move) {
    if (!nominal_.targets[from].q || !nominal_.targets[to].q) return;
    ReceiptRow& row = rows_[to];
    note_change(rows_[from], row);
    const double way = (row.p_B - rows_[from].p_B).norm();
    if (way < kLeastWay || !row.corrected()) return;
    const JointVector &was = *nominal_.targets[from].q, &is = *nominal_.targets[to].q;
    row.path_limit_before_mm_s = speed_limit(robot_, was, is, way).mm_s;
    const SpeedLimit after =
        speed_limit(robot_, joints_of(rows_[from], robot_, was), joints_of(row, robot_, is), way);
    row.path_limit_after_mm_s = after.mm_s;
    if (!move.speed_mm_s || !(*move.speed_mm_s > after.mm_s) ||
        *move.speed_mm_s > row.path_limit_before_mm_s)
      return;
    ++too_fast_;
    row.message += fmt::format("{}at {:.6g} mm/s joint {} would turn faster than it can",
                               row.message.empty() ? "" : "; ", *move.speed_mm_s, after.joint + 1);
    row.suggestion +=
        fmt::format("{}{:.4g} mm/s at most", row.suggestion.empty() ? "" : "; ", after.mm_s);
  }

  void note_change(const ReceiptRow& from, const ReceiptRow& to) {
    const double change = to_mm((to.correction_B - from.correction_B).norm());
    if (change <= result_.largest_step_mm) return;
    result_.largest_step_mm = change;
    result_.largest_step_file = to.file;
    result_.largest_step_line = to.line;
    left_beside_ = from.corrected() != to.corrected();
  }

  const Program& program_;
  const Chain& robot_;
  const NominalTargets& nominal_;
  std::vector<ReceiptRow>& rows_;
  CorrectedProgram& result_;
  int too_fast_ = 0;
  bool left_beside_ = false;
};

}  // namespace

void check_path(const Program& program, const Chain& robot, const NominalTargets& nominal,
                std::vector<ReceiptRow>& rows, CorrectedProgram& result) {
  Path(program, robot, nominal, rows, result).check();
}

}  // namespace trammel::cam
