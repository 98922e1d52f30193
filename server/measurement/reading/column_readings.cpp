#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/reading/catalogue.h"
#include "server/measurement/reading_units.h"

namespace trammel::reading {

namespace {

constexpr double kGon = 0.9;           // deg
constexpr int kMostWithManySigns = 7;  // joints of a robot: of more only single signs are tried
constexpr double kOtherUnit = 3;  // times: rows nearer than the others by this factor may be in
                                  // another unit
constexpr std::array<const char*, 3> kAxes = {"x_mm", "y_mm", "z_mm"};
constexpr const char* kAllAxes = "x_mm,y_mm,z_mm";
constexpr const char* kAllRadians = "with all joints in radians";

constexpr std::array<double, 3> kTurns = {90, -90, 180};

Reading of_joints(std::string name, std::string columns,
                  std::function<void(Eigen::MatrixXd&)> change) {
  return {std::move(name), std::move(columns), false,
          [change = std::move(change)](NumberTable table) {
            change(table.q);
            return table;
          }};
}

Reading of_positions(std::string name, std::string columns,
                     std::function<void(Eigen::Matrix3Xd&)> change) {
  return {std::move(name), std::move(columns), false,
          [change = std::move(change)](NumberTable table) {
            change(table.p_W);
            return table;
          }};
}

class JointReadings {
 public:
  JointReadings(const NumberTable& table, const Chain& robot) : table_(table), robot_(robot) {}

  std::vector<Reading> all() {
    signs();
    exchanges();
    for (int j = 0; j < robot_.size(); ++j) {
      if (turns(j)) units(j);
    }
    unit_of_all("radians", 180 / kPi);
    all_in_si();
    unit_of_all("gon", kGon);
    couplings();
    for (int j = 0; j < robot_.size(); ++j) {
      if (turns(j)) zeros(j);
    }
    return std::move(all_);
  }

 private:
  [[nodiscard]] std::string name(int j) const { return joint_column(j, robot_.joint(j).type); }
  [[nodiscard]] bool turns(int j) const { return robot_.joint(j).type == JointType::kRevolute; }
  [[nodiscard]] bool small(int j) const {
    return table_.q.row(j).cwiseAbs().maxCoeff() <= from_deg(kMostRadians);
  }
  void add(std::string name, std::string columns, std::function<void(Eigen::MatrixXd&)> change) {
    all_.push_back(of_joints(std::move(name), std::move(columns), std::move(change)));
  }

  /// Tries one joint of the other sign, then two, and so on: a mirrored drawing has several.
  void signs() {
    const int most = robot_.size() <= kMostWithManySigns ? robot_.size() : 1;
    for (int count = 1; count <= most; ++count) {
      for (unsigned set = 1; set < 1u << static_cast<unsigned>(robot_.size()); ++set) {
        if (std::popcount(set) != count) continue;
        std::vector<std::string> columns;
        Eigen::VectorXd sign = Eigen::VectorXd::Ones(robot_.size());
        for (int j = 0; j < robot_.size(); ++j) {
          if ((set >> static_cast<unsigned>(j) & 1u) == 0) continue;
          columns.push_back(name(j));
          sign(j) = -1;
        }
        add(fmt::format("with the other sign of {}", fmt::join(columns, " and ")),
            fmt::format("{}", fmt::join(columns, ",")),
            [sign](Eigen::MatrixXd& q) { q = (sign.asDiagonal() * q).eval(); });
      }
    }
  }
  void exchanges() {
    for (int i = 0; i < robot_.size(); ++i) {
      for (int j = i + 1; j < robot_.size(); ++j) {
        if (turns(i) != turns(j)) continue;
        add(fmt::format("with {} and {} exchanged", name(i), name(j)), name(i) + "," + name(j),
            [i, j](Eigen::MatrixXd& q) { q.row(i).swap(q.row(j)); });
      }
    }
  }
  void units(int j) {
    if (small(j)) {
      add(fmt::format("with {} in radians", name(j)), name(j),
          [j](Eigen::MatrixXd& q) { q.row(j) *= 180 / kPi; });
    }
    add(fmt::format("with {} in gon", name(j)), name(j),
        [j](Eigen::MatrixXd& q) { q.row(j) *= kGon; });
  }
  void unit_of_all(const char* unit, double factor) {
    std::vector<int> turning;
    for (int j = 0; j < robot_.size(); ++j) {
      if (!turns(j)) continue;
      if (factor > 1 && !small(j)) return;
      turning.push_back(j);
    }
    add(fmt::format("with all joints in {}", unit), "q1_deg",
        [turning, factor](Eigen::MatrixXd& q) {
          for (const int j : turning) q.row(j) *= factor;
        });
  }
  /// Logs of programs that count in rad and m, under our names.
  void all_in_si() {
    if (all_.empty() || all_.back().name != kAllRadians) return;
    all_.push_back({std::string(kAllRadians) + " and all positions in metres",
                    std::string("q1_deg,") + kAllAxes, false,
                    [radians = all_.back().apply](NumberTable table) {
                      table = radians(std::move(table));
                      table.p_W *= to_mm(1);
                      return table;
                    }});
  }
  /// Tries a controller that reports a joint together with the joint that drives it, or a robot
  /// file without that coupling.
  void couplings() {
    for (int j = 1; j < robot_.size(); ++j) {
      for (int by = std::max(0, j - 2); by < j; ++by) {
        if (!turns(by) || !turns(j)) continue;
        add(fmt::format("with {} subtracted from {}", name(by), name(j)), name(j),
            [j, by](Eigen::MatrixXd& q) { q.row(j) -= q.row(by); });
        add(fmt::format("with {} added to {}", name(by), name(j)), name(j),
            [j, by](Eigen::MatrixXd& q) { q.row(j) += q.row(by); });
      }
    }
  }
  void zeros(int j) {
    for (const double turn : kTurns) {
      add(fmt::format("with {:g} deg added to {}", turn, name(j)), name(j),
          [j, turn](Eigen::MatrixXd& q) { q.row(j).array() += from_deg(turn); });
      if (j + 1 == robot_.size())
        all_.back().the_same =
            fmt::format("with the tool of the cell file turned by {:g} deg about its axis", turn);
    }
  }

  const NumberTable& table_;
  const Chain& robot_;
  std::vector<Reading> all_;
};

/// Adds readings with the rows nearest to the origin in another unit: the rows below the widest gap
/// in the distances from the origin.
void add_rows_in_other_units(const NumberTable& table, std::vector<Reading>& all) {
  std::vector<double> far;
  for (std::size_t i = 0; i < table.size(); ++i) far.push_back(table.position(i).norm());
  std::sort(far.begin(), far.end());
  double widest = 0, limit = 0;
  for (std::size_t i = 1; i < far.size(); ++i) {
    if (far[i - 1] == 0 || far[i] < widest * far[i - 1]) continue;
    widest = far[i] / far[i - 1];
    limit = std::sqrt(far[i] * far[i - 1]);
  }
  if (widest < kOtherUnit) return;
  std::vector<int> rows;
  for (std::size_t i = 0; i < table.size(); ++i)
    if (table.position(i).norm() < limit) rows.push_back(table.from[i]->row);
  for (const UnitOfLength& unit : kUnitsOfLength) {
    if (unit.factor < 1) continue;
    all.push_back(of_positions(fmt::format("with {} of {} rows in {} (the first is row {})",
                                           rows.size(), table.size(), unit.name, rows.front()),
                               kAllAxes, [limit, unit](Eigen::Matrix3Xd& p) {
                                 for (Eigen::Index i = 0; i < p.cols(); ++i)
                                   if (p.col(i).norm() < limit) p.col(i) *= unit.factor;
                               }));
  }
}

Reading left_handed(int axis) {
  return {fmt::format("as of a left-handed frame (mirrored {} axis)",
                      kAxes[static_cast<std::size_t>(axis)][0]),
          std::string(kAllAxes) + ",qw,qx,qy,qz", false, [axis](NumberTable table) {
            Matrix3 mirror = Matrix3::Identity();
            mirror(axis, axis) = -1;
            table.p_W = mirror * table.p_W;
            for (auto& R_WT : table.R_WT) {
              if (R_WT) *R_WT = mirror * *R_WT * mirror;
            }
            return table;
          }};
}

/// The robot whose table has, in each row, the a and alpha of the link before; those of the last
/// row are lost in the tool.
Result<Chain> with_links_one_row_up(const Chain& robot) {
  std::vector<Joint> joints;
  for (int j = 0; j < robot.size(); ++j) {
    Joint joint = robot.joint(j);
    const LinkGeometry next = j + 1 < robot.size() ? robot.joint(j + 1).link : LinkGeometry();
    joint.link.a = next.a;
    joint.link.alpha = next.alpha;
    joint.link.beta = 0;
    joint.hayati = false;
    joints.push_back(std::move(joint));
  }
  return Chain::make(robot.name(), std::move(joints), robot.couplings());
}

}  // namespace

std::vector<Reading> robot_readings(const Chain& robot) {
  Result<Chain> turned = with_links_one_row_up(robot);
  if (!turned) return {};
  return {{"with a and alpha of the robot file one row up (Craig's convention of DH)",
           "a_mm,alpha_deg", false, [](NumberTable table) { return table; }, std::move(*turned)}};
}

std::vector<Reading> joint_readings(const NumberTable& table, const Chain& robot) {
  return JointReadings(table, robot).all();
}

std::vector<Reading> position_readings(const NumberTable& table) {
  std::vector<Reading> all;
  for (int k = 0; k < 3; ++k) {
    const std::string name = kAxes[static_cast<std::size_t>(k)];
    all.push_back(of_positions("with the other sign of " + name, name,
                               [k](Eigen::Matrix3Xd& p) { p.row(k) *= -1; }));
  }
  for (const auto& [i, j] : {std::pair(0, 1), std::pair(1, 2), std::pair(0, 2)}) {
    const std::string one = kAxes[static_cast<std::size_t>(i)];
    const std::string other = kAxes[static_cast<std::size_t>(j)];
    all.push_back(of_positions(fmt::format("with {} and {} exchanged", one, other),
                               one + "," + other,
                               [i = i, j = j](Eigen::Matrix3Xd& p) { p.row(i).swap(p.row(j)); }));
  }
  if (std::any_of(table.R_WT.begin(), table.R_WT.end(),
                  [](const auto& R) { return R.has_value(); })) {
    for (const int axis : {1, 0, 2}) all.push_back(left_handed(axis));
  }
  for (const UnitOfLength& unit : kUnitsOfLength) {
    for (int k = 0; k < 3; ++k) {
      const std::string name = kAxes[static_cast<std::size_t>(k)];
      all.push_back(of_positions(fmt::format("with {} in {}", name, unit.name), name,
                                 [k, unit](Eigen::Matrix3Xd& p) { p.row(k) *= unit.factor; }));
    }
    all.push_back(of_positions(fmt::format("with all positions in {}", unit.name), kAllAxes,
                               [unit](Eigen::Matrix3Xd& p) { p *= unit.factor; }));
  }
  add_rows_in_other_units(table, all);
  return all;
}

}  // namespace trammel::reading
