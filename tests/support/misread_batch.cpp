#include "tests/support/misread_batch.h"

#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/batch_check.h"
#include "server/measurement/checked_batch.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

namespace {

using Random = std::mt19937_64;
using Quaternion = Eigen::Quaterniond;

// Robots with six turning joints come first.
const std::vector<std::string> kRobots = {"abb_irb6640-205-275",  "abb_irb120-3-06",
                                          "abb_irb1200-5-09",     "fanuc_m-20ia",
                                          "yaskawa_gp25",         "kuka_kr210-r2700-extra",
                                          "staubli_tx2-90l",      "universal-robots_ur10",
                                          "universal-robots_ur5", "abb_irb6640-205-275-on-rail",
                                          "kuka_lbr-iiwa-7-r800"};

constexpr std::size_t kOfSixJoints = 9;

double gauss(Random& random, double stddev) {
  return std::normal_distribution<double>(0, stddev)(random);
}
double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
int pick(Random& random, int count) {
  return std::uniform_int_distribution<int>(0, count - 1)(random);
}

Eigen::MatrixXd joints_of(const FirstBatch& first, const Cell& cell, Random& random) {
  constexpr double kMostRange = 170;  // deg to each side
  Eigen::MatrixXd q(first.poses, cell.robot.size());
  for (int j = 0; j < cell.robot.size(); ++j) {
    const Joint& joint = cell.robot.joint(j);
    const bool turns = joint.type == JointType::kRevolute;
    const double low = std::max(joint.lower, turns ? from_deg(-kMostRange) : 0.0);
    const double high = std::min(joint.upper, turns ? from_deg(kMostRange) : 2.0);
    const double middle = uniform(random, low + first.spread / 2 * (high - low),
                                  high - first.spread / 2 * (high - low));
    for (double& value : q.col(j))
      value = middle + uniform(random, -first.spread / 2, first.spread / 2) * (high - low);
  }
  return q;
}

VirtualRobot as_delivered(const FirstBatch& first, const std::shared_ptr<const Cell>& cell,
                          Random& random) {
  VirtualRobot robot{demand(make_physical_model(cell, {"base", "geometry", "compliance"})),
                     first.noise,
                     60e-6,
                     {}};
  const auto parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const std::string& name = parameters[k].name;
    double& value = robot.truth.values(static_cast<Eigen::Index>(k));
    if (name.ends_with("0") && std::string("xyz").find(name.front()) != std::string::npos) {
      value = uniform(random, -first.tracker, first.tracker);
    } else if (name == "gamma0") {
      value = first.tracker > 0 ? uniform(random, -kPi, kPi) : gauss(random, 0.002);
    } else if (name.starts_with("q")) {
      value = gauss(random, first.zero);
    } else if (name.starts_with("alpha") || name.starts_with("beta")) {
      value = gauss(random, first.twist);
    } else if (name.starts_with("C")) {
      value = std::abs(gauss(random, from_rad_per_nmm(first.compliance)));
    } else {
      value = gauss(random, first.length);
    }
  }
  if (!cell->X_WB)
    robot.truth.X_WB = make_pose(rotation_exp(Vector3(0.1, -0.2, 0.5)), Vector3(1.2, -0.8, 0.4));
  for (auto& [tool, X_FT] : robot.truth.tools) {
    X_FT = make_pose(rotation_exp(Vector3(0.02, -0.01, 0.03)), Vector3(0.06, -0.12, 0.17));
    for (double& value : X_FT.translation()) value += gauss(random, first.length);
  }
  return robot;
}

std::string column(int joint) { return fmt::format("q{}_deg", joint + 1); }

/// Two that differ, in order.
std::pair<int, int> two_of(Random& random, int count) {
  const int one = pick(random, count);
  const int other = (one + 1 + pick(random, count - 1)) % count;
  return {std::min(one, other), std::max(one, other)};
}

void turn_all(MeasurementBatch& batch, const std::function<Quaternion(const Quaternion&)>& change) {
  for (Measurement& m : batch.measurements) {
    if (m.R_WT) m.R_WT = change(Quaternion(*m.R_WT)).toRotationMatrix();
  }
}

/// The positions of rows [begin, end) are those of `shift` rows later, around the end.
void shift_rows(MeasurementBatch& batch, std::size_t begin, std::size_t end, std::size_t shift) {
  const MeasurementBatch before = batch;
  const std::size_t n = end - begin;
  for (std::size_t i = 0; i < n; ++i) {
    const Measurement& from = before.measurements[begin + (i + shift) % n];
    batch.measurements[begin + i].p_W = from.p_W;
    batch.measurements[begin + i].R_WT = from.R_WT;
  }
}

const char* const kAxis[] = {"x_mm", "y_mm", "z_mm"};

std::vector<Misreading> all_misreadings() {
  std::vector<Misreading> all;
  const auto add = [&](std::string kind, bool oriented, auto make) {
    all.push_back({std::move(kind), oriented, make});
  };
  add("rows shifted by one", false, [](MeasurementBatch& b, const Cell&, Random&) {
    shift_rows(b, 0, b.measurements.size(), 1);
    return std::string("of the next row");
  });
  add("rows shifted by minus two", false, [](MeasurementBatch& b, const Cell&, Random&) {
    shift_rows(b, 0, b.measurements.size(), b.measurements.size() - 2);
    return std::string("of 2 rows before");
  });
  add("a block of rows shifted", false, [](MeasurementBatch& b, const Cell&, Random& random) {
    const std::size_t n = b.measurements.size();
    const std::size_t begin =
        n / 5 + static_cast<std::size_t>(pick(random, static_cast<int>(n / 4)));
    shift_rows(b, begin, n, 1);
    return std::string("of the next row");
  });
  add("all rows shifted by a block", false, [](MeasurementBatch& b, const Cell&, Random&) {
    shift_rows(b, 0, b.measurements.size(), b.measurements.size() / 4);
    return fmt::format("of {} rows later", b.measurements.size() / 4);
  });
  add("two joints exchanged", false, [](MeasurementBatch& b, const Cell& cell, Random& random) {
    const auto [i, j] = two_of(random, cell.robot.size());
    for (Measurement& m : b.measurements) std::swap(m.context.q(i), m.context.q(j));
    return fmt::format("with {} and {} exchanged", column(i), column(j));
  });
  add("two coordinates exchanged", false, [](MeasurementBatch& b, const Cell&, Random& random) {
    const auto [i, j] = two_of(random, 3);
    for (Measurement& m : b.measurements) std::swap(m.p_W(i), m.p_W(j));
    return fmt::format("with {} and {} exchanged", kAxis[i], kAxis[j]);
  });
  add("sign of a joint", false, [](MeasurementBatch& b, const Cell& cell, Random& random) {
    const int j = pick(random, cell.robot.size());
    for (Measurement& m : b.measurements) m.context.q(j) *= -1;
    return fmt::format("with the other sign of {}", column(j));
  });
  add("signs of several joints", false, [](MeasurementBatch& b, const Cell&, Random&) {
    for (Measurement& m : b.measurements) {
      for (const int j : {0, 3, 5}) m.context.q(j) *= -1;
    }
    return std::string("with the other sign of q1_deg and q4_deg and q6_deg");
  });
  add("half of the rows in metres", false, [](MeasurementBatch& b, const Cell&, Random&) {
    for (std::size_t i = b.measurements.size() / 2; i < b.measurements.size(); ++i)
      b.measurements[i].p_W /= 1000;
    return fmt::format("{} of {} rows in metres", b.measurements.size() - b.measurements.size() / 2,
                       b.measurements.size());
  });
  add("sign of a coordinate", false, [](MeasurementBatch& b, const Cell&, Random& random) {
    const int k = pick(random, 3);
    for (Measurement& m : b.measurements) m.p_W(k) *= -1;
    return fmt::format("with the other sign of {}", kAxis[k]);
  });
  add("a joint in radians", false, [](MeasurementBatch& b, const Cell& cell, Random& random) {
    const int j = pick(random, cell.robot.size());
    for (Measurement& m : b.measurements) m.context.q(j) *= kPi / 180;
    return fmt::format("with {} in radians", column(j));
  });
  add("a coordinate in inches", false, [](MeasurementBatch& b, const Cell&, Random& random) {
    const int k = pick(random, 3);
    for (Measurement& m : b.measurements) m.p_W(k) /= 25.4;
    return fmt::format("with {} in inches", kAxis[k]);
  });
  add("a coordinate in metres", false, [](MeasurementBatch& b, const Cell&, Random& random) {
    const int k = pick(random, 3);
    for (Measurement& m : b.measurements) m.p_W(k) /= 1000;
    return fmt::format("with {} in metres", kAxis[k]);
  });
  add("all positions in inches", false, [](MeasurementBatch& b, const Cell&, Random&) {
    for (Measurement& m : b.measurements) m.p_W /= 25.4;
    return std::string("with all positions in inches");
  });
  add("quaternions as xyzw", true, [](MeasurementBatch& b, const Cell&, Random&) {
    turn_all(b, [](const Quaternion& q) { return Quaternion(q.x(), q.y(), q.z(), q.w()); });
    return std::string("as xyzw");
  });
  add("inverse quaternions", true, [](MeasurementBatch& b, const Cell&, Random&) {
    turn_all(b, [](const Quaternion& q) { return q.conjugate(); });
    return std::string("as the inverse");
  });
  add("sign of a quaternion's part", true, [](MeasurementBatch& b, const Cell&, Random&) {
    turn_all(b, [](const Quaternion& q) { return Quaternion(q.w(), q.x(), -q.y(), q.z()); });
    return std::string("with the other sign of qy");
  });
  add("angles in radians", true, [](MeasurementBatch& b, const Cell&, Random&) {
    turn_all(b, [](const Quaternion& q) {
      const Vector3 zyx = from_deg(1) * q.toRotationMatrix().eulerAngles(2, 1, 0);
      return Quaternion(Eigen::AngleAxisd(zyx.x(), Vector3::UnitZ()) *
                        Eigen::AngleAxisd(zyx.y(), Vector3::UnitY()) *
                        Eigen::AngleAxisd(zyx.z(), Vector3::UnitX()));
    });
    return std::string("as angles in radians");
  });
  add("rotation vector in columns of angles", true, [](MeasurementBatch& b, const Cell&, Random&) {
    turn_all(b, [](const Quaternion& q) {
      const Vector3 vector = from_deg(1) * rotation_log(q.toRotationMatrix());
      return Quaternion(Eigen::AngleAxisd(vector.x(), Vector3::UnitX()) *
                        Eigen::AngleAxisd(vector.y(), Vector3::UnitY()) *
                        Eigen::AngleAxisd(vector.z(), Vector3::UnitZ()));
    });
    return std::string("as a rotation vector in radians");
  });
  add("rotation vector in degrees in columns of angles", true,
      [](MeasurementBatch& b, const Cell&, Random&) {
        turn_all(b, [](const Quaternion& q) {
          const Vector3 vector = rotation_log(q.toRotationMatrix());
          return Quaternion(Eigen::AngleAxisd(vector.x(), Vector3::UnitX()) *
                            Eigen::AngleAxisd(vector.y(), Vector3::UnitY()) *
                            Eigen::AngleAxisd(vector.z(), Vector3::UnitZ()));
        });
        return std::string("as a rotation vector");
      });
  add("turns about z, y, z in columns of A B C", true,
      [](MeasurementBatch& b, const Cell&, Random&) {
        turn_all(b, [](const Quaternion& q) {
          const Vector3 zyz = q.toRotationMatrix().eulerAngles(2, 1, 2);
          return Quaternion(Eigen::AngleAxisd(zyz.x(), Vector3::UnitZ()) *
                            Eigen::AngleAxisd(zyz.y(), Vector3::UnitY()) *
                            Eigen::AngleAxisd(zyz.z(), Vector3::UnitX()));
        });
        return std::string("as O A T");
      });
  add("left-handed tracker frame", true, [](MeasurementBatch& b, const Cell&, Random&) {
    for (Measurement& m : b.measurements) m.p_W.y() *= -1;
    turn_all(b, [](const Quaternion& q) { return Quaternion(q.w(), -q.x(), q.y(), -q.z()); });
    return std::string("left-handed");
  });
  add("another zero of a joint", false, [](MeasurementBatch& b, const Cell& cell, Random& random) {
    const int j = 1 + pick(random, cell.robot.size() - 2);
    const double turn = random() % 2 == 0 ? 90 : -90;
    for (Measurement& m : b.measurements) m.context.q(j) -= from_deg(turn);
    return fmt::format("with {:g} deg added to {}", turn, column(j));
  });
  add("joint 3 counted with joint 2", false, [](MeasurementBatch& b, const Cell&, Random&) {
    for (Measurement& m : b.measurements) m.context.q(2) += m.context.q(1);
    return std::string("with q2_deg subtracted from q3_deg");
  });
  add("another point of the tool", false,
      [](MeasurementBatch& b, const Cell& cell, Random& random) {
        Vector3 moved(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
        moved *= 0.12 / moved.norm();
        for (Measurement& m : b.measurements) {
          if (m.R_WT) m.p_W += *m.R_WT * moved;
        }
        static_cast<void>(cell);
        return std::string("another point of the tool");
      });
  all.back().needs_orientation = true;
  return all;
}

}  // namespace

FirstBatch first_batch(std::uint64_t seed, Robots robots) {
  Random random(seed * 7919);
  const auto drawn = [&](double low, double high) { return uniform(random, low, high); };
  const auto either = [&] { return random() % 2 == 0; };
  FirstBatch first;
  first.seed = seed;
  first.robot = kRobots[random() % (robots == Robots::kAll ? kRobots.size() : kOfSixJoints)];
  first.base_known = either();
  first.tool_known = either();
  first.orientation = either();
  first.poses = static_cast<int>(15 * std::pow(20, drawn(0, 1)));
  first.spread = drawn(0.2, 0.9);
  first.length = drawn(0, 3e-3);
  first.zero = drawn(0, 0.05);
  first.twist = drawn(0, 3e-3);
  first.noise = drawn(10e-6, 200e-6);
  first.compliance = drawn(0, 2e-9);
  first.outliers = either() ? 0 : drawn(0, 0.1);
  first.tracker = either() ? 0 : 2;
  return first;
}

std::shared_ptr<const Cell> new_cell(const FirstBatch& first) {
  const std::string text = fmt::format(
      "version: 1\ncell: new\nrobot: robot.yaml\nbase: {}\ntools: {{spindle: {}}}\n"
      "payloads: {{spindle: {{mass_kg: 100, cog_mm: [10, 5, 120]}}}}\ntracker: {{sigma_mm: 0.03}}\n"
      "model: {{error_sources: [base, geometry], bias: none}}\n",
      first.base_known ? "{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}" : "null",
      first.tool_known ? "{xyz_mm: [58.553, -193.735, 165.958], q_wxyz: [1, 0, 0, 0]}" : "null");
  return std::make_shared<const Cell>(demand(parse_cell(
      text, read_file(TRAMMEL_SOURCE_DIR "/models/" + first.robot + ".yaml"), "new.yaml")));
}

MeasurementBatch measured_first(const FirstBatch& first, const Cell& cell) {
  Random random(first.seed);
  const auto shared = std::make_shared<const Cell>(cell);
  VirtualRobot robot = as_delivered(first, shared, random);
  if (first.tool_known) {
    for (auto& [tool, X_FT] : robot.truth.tools) {
      X_FT = *cell.tools.at(tool);
      for (double& value : X_FT.translation()) value += gauss(random, first.length);
    }
  }
  SimulateOptions options;
  options.seed = first.seed;
  options.orientation = first.orientation;
  MeasurementBatch batch = demand(simulate(robot, joints_of(first, cell, random), options));
  for (Measurement& m : batch.measurements) {
    if (uniform(random, 0, 1) < first.outliers)
      m.p_W += Vector3(uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3),
                       uniform(random, -0.3, 0.3));
  }
  return batch;
}

const std::vector<Misreading>& misreadings() {
  static const std::vector<Misreading> all = all_misreadings();
  return all;
}

std::optional<Error> said_of(MeasurementBatch batch, const Cell& cell) {
  batch.source_text.clear();
  const auto checked = check_against_cell(std::move(batch), cell);
  if (!checked) return checked.error();
  return batch_doubt(checked->rows(), cell);
}

bool names(const Error& error, const std::string& reading) {
  return (error.message + " " + error.next + " " + error.text).find(reading) != std::string::npos;
}

}  // namespace trammel::test
