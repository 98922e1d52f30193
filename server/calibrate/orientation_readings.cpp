#include "server/calibrate/orientation_readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/median.h"
#include "server/measurement/reading_units.h"
#include "server/robot/three_numbers.h"

namespace trammel::orientations {

namespace {

constexpr double kMostCounted =
    from_deg(30);  // larger errors count the same: wrong is wrong, and few rows must not decide
constexpr double kGon = 0.9;  // deg
constexpr std::size_t kMostTries =
    40;  // poses with their own R_FT as trial: half may be wrong, one must be right
constexpr std::size_t kRowsOfFirstLook = 24;  // evenly drawn, to find the hopeless among many
                                              // readings

/// The numbers (x, y, z, w) in place of (w, x, y, z), and the reverse.
Quaternion from_xyzw(const Quaternion& q) { return {q.z(), q.w(), q.x(), q.y()}; }
Quaternion from_wxyz(const Quaternion& q) { return {q.x(), q.y(), q.z(), q.w()}; }

/// The numbers as `reread` changes them, with the base turned by q_WB.
template <typename Reread>
Reading reading(std::string name, const Oriented& group, const Quaternion& q_WB,
                const Reread& reread) {
  Reading one{.name = std::move(name), .q_FT = {}, .remedy = {}, .or_else = {}};
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    const Quaternion q_BF(group.X_BF[i].linear());
    one.q_FT.push_back(q_BF.conjugate() *
                       (q_WB.conjugate() * reread(Quaternion(*group.rows[i]->R_WT))));
  }
  return one;
}

Quaternion as_it_is(const Quaternion& q) { return q; }

/// Adds readings with one of four columns negated, with two exchanged, or of a left-handed frame.
void add_columns(const Oriented& group, const Quaternion& q_WB, std::vector<Reading>& all) {
  const std::array<const char*, 4> columns = {"qx", "qy", "qz", "qw"};  // as Eigen counts
  const auto add = [&](const std::string& name, const auto& change) {
    all.push_back(reading(name, group, q_WB, [&](const Quaternion& q) {
      Eigen::Vector4d numbers = q.coeffs();
      change(numbers);
      return Quaternion(numbers);
    }));
  };
  for (std::size_t k = 0; k < 3; ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    add(fmt::format("with the other sign of {}", columns[k]),
        [&](Eigen::Vector4d& q) { q(at) *= -1; });
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    for (std::size_t j = i + 1; j < columns.size(); ++j) {
      add(fmt::format("with {} and {} exchanged", columns[i], columns[j]), [&](Eigen::Vector4d& q) {
        std::swap(q(static_cast<Eigen::Index>(i)), q(static_cast<Eigen::Index>(j)));
      });
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    add(fmt::format("as of a left-handed frame (mirrored {} axis)", columns[k][1]),
        [&](Eigen::Vector4d& q) {
          for (std::size_t other = 0; other < 3; ++other)
            q(static_cast<Eigen::Index>(other)) *= other == k ? 1 : -1;
        });
  }
}

/// Adds readings in which the last joint has another unit, or counts together with an earlier
/// joint. A point on the joint's axis does not show such mistakes.
void add_last_joint(const Oriented& group, const Quaternion& q_WB, const Chain& robot,
                    std::vector<Reading>& all) {
  const int last = robot.size() - 1;
  if (robot.joint(last).type != JointType::kRevolute) return;
  const auto add = [&](std::string name, const auto& change) {
    Oriented changed = group;
    for (std::size_t i = 0; i < group.rows.size(); ++i) {
      JointVector q = group.rows[i]->context.q;
      change(q);
      changed.X_BF[i] = robot.flange_pose(q);
    }
    all.push_back(reading(std::move(name), changed, q_WB, as_it_is));
    all.back().by_order = false;
  };
  const std::string column = fmt::format("q{}_deg", last + 1);
  add(fmt::format("with {} in radians", column), [&](JointVector& q) { q(last) *= 180 / kPi; });
  add(fmt::format("with {} in gon", column), [&](JointVector& q) { q(last) *= kGon; });
  for (int by = std::max(0, last - 2); by < last; ++by) {
    if (robot.joint(by).type != JointType::kRevolute) continue;
    add(fmt::format("with q{}_deg subtracted from {}", by + 1, column),
        [&](JointVector& q) { q(last) -= q(by); });
    add(fmt::format("with q{}_deg added to {}", by + 1, column),
        [&](JointVector& q) { q(last) += q(by); });
  }
}

/// The names of the orientation columns if the three numbers follow `way`.
std::string remedy_of(const ThreeNumbers& way, bool in_radians) {
  if (way.columns.empty()) return "write the orientation as a quaternion: qw, qx, qy, qz";
  const char* unit = in_radians ? "rad" : "deg";
  if (way.is_vector) return fmt::format("name its columns rvx_{0}, rvy_{0}, rvz_{0}", unit);
  if (in_radians) return "write the unit into the names of their columns: A_rad, Rx (rad)";
  return fmt::format("name the columns {}, as they are meant", way.columns_text());
}

/// At most `count` rows of a tool, evenly drawn.
Oriented some_of(const Oriented& group, std::size_t count) {
  const std::size_t n = group.rows.size(), kept = std::min(n, count);
  Oriented some{group.tool, {}, {}};
  for (std::size_t k = 0; k < kept; ++k) {
    some.rows.push_back(group.rows[k * n / kept]);
    some.X_BF.push_back(group.X_BF[k * n / kept]);
  }
  return some;
}

/// Adds the same three numbers as radians, in another order of turns, or as a rotation vector. The
/// file may contain them in any of these ways. Numbers in the wrong way fit nothing. If the file
/// had turns, only the orientation remains, and two triples of numbers may have produced it.
void add_three_numbers(const Oriented& group, const Quaternion& q_WB, std::vector<Reading>& all) {
  const std::vector<ThreeNumbers>& ways = ways_of_three_numbers();
  const Oriented few = some_of(group, kRowsOfFirstLook);
  for (const ThreeNumbers& was : ways) {
    if (was.columns.empty()) continue;  // no file uses that
    const bool small = std::all_of(group.rows.begin(), group.rows.end(), [&](const Measurement* m) {
      return was.numbers(*m->R_WT)[0].cwiseAbs().maxCoeff() <= from_deg(kMostRadians);
    });
    for (const ThreeNumbers& meant : ways) {
      const bool same = &was == &meant;
      if (same && (!small || was.is_vector)) continue;
      const bool reversed = !same && was.axes == meant.axes && !was.is_vector;
      if (reversed && was.from_behind) continue;  // A B C is W P R in reverse order
      std::string name = same       ? "as angles"
                         : reversed ? "with the three angles from behind (A B C, W P R)"
                                    : "as " + meant.name;
      if (small) name += " in radians";
      const auto reread = [&](std::size_t way) {
        return [&, way](const Quaternion& q) {
          return meant.rotation((small ? to_deg(1) : 1) * was.numbers(q.matrix())[small ? 0 : way]);
        };
      };
      const Quaternions q = reading("", few, q_WB, reread(0)).q_FT,
                        other = reading("", few, q_WB, reread(1)).q_FT;
      if (median(nearer(q, other, common(q, other))) > kMostOff) continue;
      Reading one = reading(std::move(name), group, q_WB, reread(0));
      one.or_else = reading("", group, q_WB, reread(1)).q_FT;
      one.by_order = false;
      one.remedy = remedy_of(meant, small);
      all.push_back(std::move(one));
    }
  }
}

}  // namespace

std::vector<Reading> readings(const Oriented& group, const Quaternion& q_WB, const Chain& robot) {
  const auto inverse = [](const Quaternion& q) { return q.conjugate(); };
  std::vector<Reading> all = {
      reading("as given", group, q_WB, as_it_is),
      reading("as xyzw", group, q_WB, from_xyzw),
      reading("as the inverse", group, q_WB, inverse),
      reading("as xyzw and the inverse", group, q_WB,
              [](const Quaternion& q) { return from_xyzw(q).conjugate(); }),
      reading("as wxyz under an xyzw header", group, q_WB, from_wxyz),
      reading("as wxyz under an xyzw header and the inverse", group, q_WB,
              [](const Quaternion& q) { return from_wxyz(q).conjugate(); }),
  };
  add_columns(group, q_WB, all);
  const auto add = [&](Reading one) {
    one.by_order = false;
    all.push_back(std::move(one));
  };
  add(reading("against the robot's base instead of the tracker", group, Quaternion::Identity(),
              as_it_is));
  add(reading("as the inverse, against the robot's base", group, Quaternion::Identity(), inverse));
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type != JointType::kRevolute) continue;
    Oriented reversed = group;
    for (std::size_t i = 0; i < group.rows.size(); ++i) {
      JointVector q = group.rows[i]->context.q;
      q(j) = -q(j);
      reversed.X_BF[i] = robot.flange_pose(q);
    }
    add(reading(fmt::format("with the other sign of q{}_deg", j + 1), reversed, q_WB, as_it_is));
  }
  for (const bool next : {true, false}) {
    Oriented shifted = group;
    std::rotate(shifted.X_BF.begin(), next ? shifted.X_BF.begin() + 1 : shifted.X_BF.end() - 1,
                shifted.X_BF.end());
    add(reading(next ? "as those of the next row" : "as those of the row before", shifted, q_WB,
                as_it_is));
  }
  add_last_joint(group, q_WB, robot, all);
  add_three_numbers(group, q_WB, all);
  return all;
}

std::vector<double> angles(const Quaternions& q_FT, const Quaternion& about) {
  std::vector<double> all;
  for (const Quaternion& q : q_FT) all.push_back(angle(q, about));
  return all;
}

std::vector<double> nearer(const Quaternions& one, const Quaternions& other,
                           const Quaternion& about) {
  std::vector<double> all = angles(one, about);
  const std::vector<double> others = angles(other, about);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = std::min(all[i], others[i]);
  return all;
}

Quaternion common(const Quaternions& one, const Quaternions& other) {
  const std::size_t n = one.size();
  const std::size_t step = std::max<std::size_t>(1, n / kMostTries);
  Quaternion best = one.front();
  double least = -1;
  for (std::size_t i = 0; i < n; i += step) {
    for (const Quaternion& tried : {one[i], other[i]}) {
      double sum = 0;
      for (const double off : nearer(one, other, tried)) sum += std::min(off, kMostCounted);
      if (least < 0 || sum < least) least = sum, best = tried;
    }
  }
  for (int round = 0; round < 2; ++round) {
    const std::vector<double> off = nearer(one, other, best);
    const double near = 3 * median(off) + 1e-9;
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      if (off[i] > near) continue;
      const bool by_other = angle(other[i], best) < angle(one[i], best);
      const Eigen::Vector4d q = (by_other ? other : one)[i].coeffs();
      sum += q.dot(best.coeffs()) < 0 ? Eigen::Vector4d(-q) : q;
    }
    best = Quaternion(Eigen::Vector4d(sum.normalized()));
  }
  return best;
}

}  // namespace trammel::orientations
