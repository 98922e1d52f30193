#include "server/calibrate/instruments/arc_list.h"

#include <array>
#include <cmath>
#include <map>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_columns.h"

namespace trammel {

namespace {

constexpr double kSameAngle = 1e-6;  // rad: a held joint reads the same to its last digit
constexpr double kPointLimit = 1e5;  // m: no instrument measures farther

/// Refuses a joint that follows another one, since its axis moves.
Status check_robot(const Chain& robot, const ArcList& arcs) {
  for (int j = 0; j < robot.size(); ++j) {
    for (int before = 0; before < j; ++before) {
      if (robot.transmission()(before, j) == 0) continue;
      return refused("robot {}: joint {} follows joint {}, so that its axis moves", robot.name(),
                     before + 1, j + 1)
          .of(fmt::format("joint {}", before + 1));
    }
  }
  for (const ArcPoint& point : arcs.points) {
    if (point.q.size() == robot.size() && point.joint >= 0 && point.joint < robot.size()) continue;
    return refused("{} joints, robot {} has {}", point.q.size(), robot.name(), robot.size())
        .in(arcs.where)
        .at_row(point.row)
        .beyond(point.q.size(), robot.size());
  }
  return {};
}

/// Refuses an arc of a prismatic joint, and a prismatic joint that moves while arcs are drawn: no
/// arc shows its axis.
Status check_slides(const Chain& robot, const ArcList& arcs) {
  for (const ArcPoint& point : arcs.points) {
    for (int j = 0; j < robot.size(); ++j) {
      if (robot.joint(j).type != JointType::kPrismatic) continue;
      if (point.joint == j) {
        return refused("joint {} of robot {} slides and draws no arc", j + 1, robot.name())
            .in(arcs.where)
            .at_row(point.row)
            .of("joint")
            .with_value(j + 1)
            .next("leave its rows out: the arcs of the turning joints tell their links");
      }
      const double place = point.q(j), before = arcs.points.front().q(j);
      if (std::abs(place - before) < kSameAngle) continue;
      return refused("joint {} slides, and is at {:.3f} mm here, at {:.3f} mm before", j + 1,
                     to_mm(place), to_mm(before))
          .in(arcs.where)
          .at_row(point.row)
          .of(joint_column(j, JointType::kPrismatic))
          .beyond(to_mm(place), to_mm(before))
          .next(
              "hold it at one place while all arcs are drawn: no arc shows along which line it "
              "slides");
    }
  }
  return {};
}

/// The columns of an arc's numbers.
struct ArcColumns {
  std::size_t joint = 0, angle = 0;
  std::array<std::size_t, 3> position{};
  std::optional<std::size_t> reflector;
  PoseColumns posture;  ///< of the held joints; without columns they are at zero
};

Result<ArcColumns> find_columns(const CsvTable& table, const std::string& where,
                                const Chain& robot) {
  PoseColumns posture = TRY(PoseColumns::find(table));
  const std::size_t held = posture.joint_types().size();
  if (held != 0 && held != static_cast<std::size_t>(robot.size())) {
    return refused("{} posture columns, robot {} has {} joints", held, robot.name(), robot.size())
        .in(where)
        .beyond(held, robot.size());
  }
  std::array<std::size_t, 5> found{};
  for (std::size_t k = 0; const char* name : {"joint", "q_deg", "x_mm", "y_mm", "z_mm"}) {
    const std::size_t column = TRY(table.require(name));
    found[k++] = column;
  }
  return ArcColumns{.joint = found[0],
                    .angle = found[1],
                    .position = {found[2], found[3], found[4]},
                    .reflector = table.find("reflector"),
                    .posture = std::move(posture)};
}

Result<ArcPoint> read_point(const CsvTable& table, std::size_t row, const ArcColumns& columns,
                            const Chain& robot) {
  const int joint = TRY(table.integer(row, columns.joint, 1, robot.size()));
  ArcPoint point;
  point.joint = joint - 1;
  point.row = table.line(row);
  point.q = JointVector::Zero(robot.size());
  if (!columns.posture.joint_types().empty()) {
    const JointVector q = TRY(columns.posture.joints(table, row));
    point.q = q;
  }
  const double angle = TRY(table.number(row, columns.angle));
  point.q(point.joint) = from_deg(angle);
  for (std::size_t k = 0; k < 3; ++k) {
    const double mm = TRY(table.number(row, columns.position[k], to_mm(kPointLimit)));
    point.p_W(static_cast<Eigen::Index>(k)) = from_mm(mm);
  }
  if (columns.reflector) point.reflector = table.field(row, *columns.reflector);
  return point;
}

}  // namespace

Result<ArcList> parse_arcs_csv(const std::string& text, const std::string& where,
                               const Chain& robot) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  const ArcColumns columns = TRY(find_columns(table, where, robot));
  ArcList arcs{where, {}};
  for (std::size_t row = 0; row < table.size(); ++row) {
    ArcPoint point = TRY(read_point(table, row, columns, robot));
    arcs.points.push_back(std::move(point));
  }
  return arcs;
}

Result<ArcList> read_arcs_csv(const std::string& path, const Chain& robot) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_arcs_csv(text, path, robot); });
}

namespace {

constexpr std::size_t kFewestOfArc = 3;        // points that a circle in space goes through
constexpr std::size_t kFewestToTellSigma = 5;  // points that leave two equations over

Status check_size(const std::vector<const ArcPoint*>& points, const ArcList& arcs,
                  bool sigma_stated) {
  const std::size_t least = sigma_stated ? kFewestOfArc : kFewestToTellSigma;
  if (points.size() >= least) return {};
  return refused("the arc of joint {} has {} points, at least {} are needed{}",
                 points.front()->joint + 1, points.size(), least,
                 sigma_stated ? "" : " where sigma is not stated")
      .in(arcs.where)
      .at_row(points.front()->row)
      .of("joint")
      .beyond(points.size(), least);
}

/// Refuses an arc during which a held joint moves. Joints before the turning one must also keep
/// their place for all arcs of that joint. Joints beyond it may differ between arcs with different
/// reflectors.
Status check_held(const std::vector<const ArcPoint*>& points, const JointArcs& group,
                  const ArcList& arcs) {
  const int turning = points.front()->joint;
  for (const ArcPoint* point : points) {
    for (int j = 0; j < static_cast<int>(point->q.size()); ++j) {
      const double from = j < turning ? group.posture(j) : points.front()->q(j);
      if (j == turning || std::abs(point->q(j) - from) < kSameAngle) continue;
      return refused("joint {} is at {:.6g} deg, held at {:.6g} deg while joint {} turns", j + 1,
                     to_deg(point->q(j)), to_deg(from), turning + 1)
          .in(arcs.where)
          .at_row(point->row)
          .of(fmt::format("q{}_deg", j + 1))
          .beyond(to_deg(point->q(j)), to_deg(from));
    }
  }
  return {};
}

}  // namespace

Result<std::vector<JointArcs>> sorted_by_joint(const Chain& robot, const ArcList& arcs,
                                               bool sigma_stated) {
  TRY(check_robot(robot, arcs));
  TRY(check_slides(robot, arcs));
  std::map<std::pair<int, std::string>, std::vector<const ArcPoint*>> by_arc;
  for (const ArcPoint& point : arcs.points)
    by_arc[{point.joint, point.reflector}].push_back(&point);
  std::vector<JointArcs> joints(static_cast<std::size_t>(robot.size()));
  for (const auto& [key, points] : by_arc) {
    JointArcs& group = joints[static_cast<std::size_t>(key.first)];
    TRY(check_size(points, arcs, sigma_stated));
    if (group.arcs.empty()) group.posture = points.front()->q;
    TRY(check_held(points, group, arcs));
    group.arcs.push_back(points);
  }
  for (int j = 0; j < robot.size(); ++j) {
    JointArcs& group = joints[static_cast<std::size_t>(j)];
    group.joint = j;
    if (group.arcs.empty() && robot.joint(j).type != JointType::kPrismatic)
      return refused("no arc of joint {}", j + 1).in(arcs.where).of("joint").with_value(j + 1);
  }
  return joints;
}

}  // namespace trammel
