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

constexpr double kSameAngle = 1e-6;  // rad, of a joint that is held
constexpr double kPointLimit = 1e5;  // m

/// Refuses a robot whose joints do not all draw arcs about axes that stand still.
Status check_robot(const Chain& robot, const ArcList& arcs) {
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type == JointType::kPrismatic) {
      return refused("robot {} joint {} slides and draws no arc", robot.name(), j + 1)
          .of(fmt::format("joint {}", j + 1))
          .next("measure the arm without it");
    }
    for (int before = 0; before < j; ++before) {
      if (robot.transmission()(before, j) == 0) continue;
      return refused("robot {}: joint {} follows joint {}, so that its axis moves", robot.name(), before + 1, j + 1)
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

}  // namespace

Result<ArcList> parse_arcs_csv(const std::string& text, const std::string& where, const Chain& robot) {
  const Result<CsvTable> table = CsvTable::parse(text, where);
  if (!table) return tl::make_unexpected(table.error());
  const Result<PoseColumns> posture = PoseColumns::find(*table);
  if (!posture) return tl::make_unexpected(posture.error());
  const std::size_t held = posture->joint_types().size();
  if (held != 0 && held != static_cast<std::size_t>(robot.size())) {
    return refused("{} posture columns, robot {} has {} joints", held, robot.name(), robot.size())
        .in(where)
        .beyond(held, robot.size());
  }
  std::array<std::size_t, 5> columns{};
  for (std::size_t k = 0; const char* name : {"joint", "q_deg", "x_mm", "y_mm", "z_mm"}) {
    const Result<std::size_t> column = table->require(name);
    if (!column) return tl::make_unexpected(column.error());
    columns[k++] = *column;
  }
  const std::optional<std::size_t> reflector = table->find("reflector");
  ArcList arcs{where, {}};
  for (std::size_t row = 0; row < table->size(); ++row) {
    const Result<int> joint = table->integer(row, columns[0], 1, robot.size());
    if (!joint) return tl::make_unexpected(joint.error());
    ArcPoint point;
    point.joint = *joint - 1;
    point.row = table->line(row);
    point.q = JointVector::Zero(robot.size());
    if (held != 0) {
      const Result<JointVector> q = posture->joints(*table, row);
      if (!q) return tl::make_unexpected(q.error());
      point.q = *q;
    }
    const Result<double> angle = table->number(row, columns[1]);
    if (!angle) return tl::make_unexpected(angle.error());
    point.q(point.joint) = from_deg(*angle);
    for (int k = 0; k < 3; ++k) {
      const Result<double> mm = table->number(row, columns[static_cast<std::size_t>(2 + k)], to_mm(kPointLimit));
      if (!mm) return tl::make_unexpected(mm.error());
      point.p_W(k) = from_mm(*mm);
    }
    if (reflector) point.reflector = table->field(row, *reflector);
    arcs.points.push_back(std::move(point));
  }
  return arcs;
}

Result<ArcList> read_arcs_csv(const std::string& path, const Chain& robot) {
  return read_text_file(path).and_then([&](const std::string& text) { return parse_arcs_csv(text, path, robot); });
}

Result<std::vector<JointArcs>> sorted_by_joint(const Chain& robot, const ArcList& arcs, bool sigma_stated) {
  if (const Status fits = check_robot(robot, arcs); !fits) return tl::make_unexpected(fits.error());
  std::map<std::pair<int, std::string>, std::vector<const ArcPoint*>> by_arc;
  for (const ArcPoint& point : arcs.points) by_arc[{point.joint, point.reflector}].push_back(&point);
  std::vector<JointArcs> joints(static_cast<std::size_t>(robot.size()));
  const std::size_t least = sigma_stated ? 3 : 5;
  for (const auto& [key, points] : by_arc) {
    JointArcs& group = joints[static_cast<std::size_t>(key.first)];
    if (points.size() < least) {
      return refused("the arc of joint {} has {} points, at least {} are needed{}", key.first + 1, points.size(), least,
                     sigma_stated ? "" : " where sigma is not stated")
          .in(arcs.where)
          .at_row(points.front()->row)
          .of("joint")
          .beyond(points.size(), least);
    }
    if (group.arcs.empty()) group.posture = points.front()->q;
    for (const ArcPoint* point : points) {
      for (int j = 0; j < robot.size(); ++j) {
        // Another reflector may be read with the joints beyond it elsewhere; within an arc nothing may move.
        const double from = j < key.first ? group.posture(j) : points.front()->q(j);
        if (j == key.first || std::abs(point->q(j) - from) < kSameAngle) continue;
        return refused("joint {} is at {:.6g} deg, held at {:.6g} deg while joint {} turns", j + 1, to_deg(point->q(j)),
                       to_deg(from), key.first + 1)
            .in(arcs.where)
            .at_row(point->row)
            .of(fmt::format("q{}_deg", j + 1))
            .beyond(to_deg(point->q(j)), to_deg(from));
      }
    }
    group.arcs.push_back(points);
  }
  for (int j = 0; j < robot.size(); ++j) {
    JointArcs& group = joints[static_cast<std::size_t>(j)];
    group.joint = j;
    if (group.arcs.empty()) return refused("no arc of joint {}", j + 1).in(arcs.where).of("joint").with_value(j + 1);
  }
  return joints;
}

}  // namespace trammel
