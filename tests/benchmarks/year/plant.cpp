#include "tests/benchmarks/year/plant.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include "server/base/units.h"
#include "server/plan/plan.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel::year {
namespace {

using test::demand;

constexpr double kSecondsPerPose = 20;
constexpr double kSigma = 15e-6;  // m

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  [[nodiscard]] double uniform(double low, double high) {
    return std::uniform_real_distribution<>(low, high)(random_);
  }
  [[nodiscard]] double normal() { return std::normal_distribution<>()(random_); }
  [[nodiscard]] int whole(int low, int high) {
    return std::uniform_int_distribution<>(low, high)(random_);
  }
  [[nodiscard]] double sign() { return whole(0, 1) == 0 ? -1 : 1; }

 private:
  std::mt19937_64 random_;
};

/// 52 weeks before today, Unix time, s.
double first_monday() {
  static const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count() - (kWeeks + 1) * kWeek;
}

void add(VirtualRobot& robot, const std::string& begins, double by, double share = 1) {
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].name.starts_with(begins))
      robot.truth.values(static_cast<Eigen::Index>(k)) += share * by;
  }
}

/// The values of the source called `name`, as a range of indices.
std::pair<Eigen::Index, Eigen::Index> values_of(const PhysicalModel& truth,
                                                const std::string& name) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : truth.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (source->name() == name) return {first, first + count};
    first += count;
  }
  return {0, 0};
}

/// m, about how far the flange gets.
double reach(const Chain& robot) {
  double sum = 0;
  for (int i = 1; i < robot.size(); ++i)
    sum += std::hypot(robot.joint(i).link.a, robot.joint(i).link.d);
  return sum;
}

/// The arm as it left the factory: links, gearboxes that give way under the payload and ripple.
VirtualRobot new_arm(const std::shared_ptr<const Cell>& cell, double payload_kg, Draw& draw) {
  VirtualRobot robot;
  std::vector<std::string> sources{"geometry", "compliance_equilibrium", "tool", "payload",
                                   "thermal_growth"};
  std::vector<std::array<double, 2>> ripples;
  for (int joint = 1; joint <= 4; ++joint) {
    sources.push_back(fmt::format("gear_transmission:{}@{:.1f}", joint, draw.uniform(25, 90)));
    ripples.push_back({draw.normal() * 2e-5, draw.normal() * 2e-5});
  }
  robot.truth = demand(make_physical_model(cell, sources));
  robot.sigma = cell->tracker.sigma;
  robot.sigma_rotation = cell->tracker.sigma_rotation;
  const std::vector<Parameter> parameters = robot.truth.parameters();
  const auto [link, end] = values_of(robot.truth, "geometry");
  const double sag = 5e-4 / (payload_kg * kGravity * reach(cell->robot));  // rad/Nm
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    double& value = robot.truth.values(static_cast<Eigen::Index>(k));
    const std::string& name = parameters[k].name;
    if (name.starts_with("C")) value = sag * draw.uniform(0.4, 1.6) * (name > "C3" ? 3 : 1);
    const auto at = static_cast<Eigen::Index>(k);
    if (at >= link && at < end) value = draw.normal() * 0.15 * parameters[k].prior_scale;
  }
  for (std::size_t joint = 1; joint <= ripples.size(); ++joint) {
    add(robot, fmt::format("gear_sin{}", joint), ripples[joint - 1][0]);
    add(robot, fmt::format("gear_cos{}", joint), ripples[joint - 1][1]);
  }
  return robot;
}

Event collision(int week, Draw& draw) {
  const int joint = draw.whole(2, 5);
  const double off = draw.sign() * draw.uniform(4e-4, 1.2e-3);
  return {
      .week = week,
      .what = fmt::format("a collision: joint {} lost its zero by {:.2f} mrad", joint, 1e3 * off),
      .source = "geometry",
      .changes = {{fmt::format("q{}", joint), off}},
      .names = {"joint_slip", "geometry"},
      .joint = joint};
}

Event knocked_tool(int week, Draw& draw) {
  const double x = draw.sign() * draw.uniform(2e-4, 6e-4),
               z = draw.sign() * draw.uniform(2e-4, 6e-4);
  return {.week = week,
          .what = fmt::format("another tool: off by {:.2f} and {:.2f} mm in x and z", to_mm(x),
                              to_mm(z)),
          .source = "tool",
          .changes = {{"tx", x}, {"tz", z}},
          .names = {"tool_changed", "tool"}};
}

Event heavier_payload(int week, double payload_kg, Draw& draw) {
  const double more = payload_kg * draw.uniform(0.25, 0.5);
  return {.week = week,
          .what = fmt::format("{:.1f} kg more on the flange", more),
          .source = "payload",
          .changes = {{"mass", more}},
          .names = {"payload_changed", "payload"}};
}

/// A gearbox that gets softer, by as much as it gives way anyhow until the end of the year.
Event wear(int week, const VirtualRobot& arm, Draw& draw) {
  const int joint = draw.whole(2, 3);
  const std::string name = fmt::format("C{}", joint);
  double by = 0;
  const std::vector<Parameter> parameters = arm.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].name == name) by = arm.truth.values(static_cast<Eigen::Index>(k));
  }
  return {.week = week,
          .what = fmt::format("joint {} wears: twice as soft at the end of the year", joint),
          .source = "compliance",
          .changes = {{name, by}},
          .names = {"compliance"},
          .joint = joint,
          .slow = true};
}

Event warm_links(Draw& draw) {
  const double growth = draw.uniform(9e-6, 13e-6);
  return {.week = 0,
          .what = fmt::format("links grow by {:.1f} um per m and K with the hall", 1e6 * growth),
          .source = "thermal_growth",
          .changes = {{"growth", growth}},
          .names = {"thermal_growth", "lagged_growth"}};
}

/// Two or three sudden events at least nine weeks apart; every fourth arm wears, every sixth grows
/// with the hall.
std::vector<Event> drawn_events(const VirtualRobot& arm, double payload_kg, std::uint64_t seed,
                                Draw& draw) {
  std::vector<Event> events;
  for (int week = draw.whole(5, 12), kind = draw.whole(0, 2); week < kWeeks - 2;
       week += draw.whole(10, 22), kind = (kind + 1) % 3) {
    if (kind == 0) events.push_back(collision(week, draw));
    if (kind == 1) events.push_back(knocked_tool(week, draw));
    if (kind == 2) events.push_back(heavier_payload(week, payload_kg, draw));
  }
  if (seed % 4 == 1) events.push_back(wear(draw.whole(4, 10), arm, draw));
  if (seed % 6 == 2) events.push_back(warm_links(draw));
  return events;
}

std::string written_cell(const std::string& name, const std::string& model, double payload_kg) {
  return fmt::format(
      "version: 1\ncell: {}\nrobot: {}/models/{}.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, "
      "0, 0]}}\n"
      "gravity: [0, 0, -1]\ntools: {{spindle: {{xyz_mm: [60, 0, 140], q_wxyz: [0.923879532511287, "
      "0, -0.382683432365090, 0]}}}}\npayloads: {{spindle: {{mass_kg: {}, cog_mm: [20, 0, 90]}}}}\n"
      "tracker: {{sigma_mm: {}, sigma_deg: 0.004}}\ntolerance_mm: 0.1\n"
      "model: {{error_sources: [base, geometry, compliance], bias: se}}\n",
      name, TRAMMEL_SOURCE_DIR, model, payload_kg, to_mm(kSigma));
}

}  // namespace

Arm::Arm(const std::string& name, const std::string& model, double payload_kg, std::uint64_t seed)
    : cell_yaml_(written_cell(name, model, payload_kg)) {
  const test::TemporaryFolder folder;
  cell_ = std::make_shared<const Cell>(demand(read_cell(folder.write("cell.yaml", cell_yaml_))));
  Draw draw(977 * seed + 5);
  robot_ = new_arm(cell_, payload_kg, draw);
  events_ = drawn_events(robot_, payload_kg, seed, draw);
}

bool Arm::is_hit(int week) const {
  return std::any_of(events_.begin(), events_.end(),
                     [&](const Event& e) { return !e.slow && e.week == week; });
}

bool Arm::is_wearing(int week) const {
  return std::any_of(events_.begin(), events_.end(),
                     [&](const Event& e) { return e.slow && e.week <= week; });
}

double Arm::temperature(int week) const { return 20 + 6 * std::sin(2 * M_PI * week / kWeeks); }

VirtualRobot Arm::in_week(int week) const {
  VirtualRobot now = robot_;
  for (const Event& event : events_) {
    if (event.week > week) continue;
    const double share =
        event.slow ? static_cast<double>(week - event.week) / (kWeeks - event.week) : 1;
    for (const auto& [name, by] : event.changes) add(now, name, by, share);
  }
  return now;
}

Eigen::MatrixXd Arm::poses(int count, std::uint64_t seed) const {
  return demand(plan_poses(*cell_, {count, seed}));
}

std::vector<PoseContext> Arm::contexts(const Eigen::MatrixXd& q, int week) const {
  std::vector<PoseContext> poses(static_cast<std::size_t>(q.rows()));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].q = q.row(static_cast<Eigen::Index>(i));
    poses[i].time =
        std::floor(first_monday() + week * kWeek) + kSecondsPerPose * static_cast<double>(i);
    poses[i].temperature = temperature(week);
  }
  return poses;
}

Eigen::Matrix3Xd Arm::true_positions(const Eigen::MatrixXd& q, int week) const {
  SimulateOptions exact;
  exact.noise = false;
  const MeasurementBatch truth = demand(simulate(in_week(week), contexts(q, week), exact));
  Eigen::Matrix3Xd positions(3, q.rows());
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    positions.col(i) = truth.measurements[static_cast<std::size_t>(i)].p_W;
  return positions;
}

MeasurementBatch Arm::measured(const Eigen::MatrixXd& q, int week, std::uint64_t seed,
                               bool set_up_anew) const {
  SimulateOptions options;
  options.seed = seed;
  MeasurementBatch batch = demand(simulate(in_week(week), contexts(q, week), options));
  if (!set_up_anew) return batch;
  Draw draw(seed + 3);
  Pose X = Pose::Identity();
  X.linear() = rotation_exp(Vector3(0, 0, draw.uniform(-0.3, 0.3)));
  X.translation() =
      Vector3(draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5), draw.uniform(-0.2, 0.2));
  for (Measurement& m : batch.measurements) {
    m.p_W = X * m.p_W;
    if (m.R_WT) m.R_WT = X.linear() * *m.R_WT;
  }
  return batch;
}

std::vector<Arm> plant(int cells, std::uint64_t seed) {
  const std::vector<std::pair<std::string, double>> types = {
      {"abb_irb6640-205-275", 100}, {"kuka_kr210-r2700-extra", 120},
      {"fanuc_m-20ia", 15},         {"staubli_tx2-90l", 8},
      {"yaskawa_gp25", 18},         {"abb_irb1200-5-09", 4},
      {"universal-robots_ur10", 8}};
  std::vector<Arm> arms;
  for (int i = 0; i < cells; ++i) {
    const auto& [model, payload_kg] = types[static_cast<std::size_t>(i) % types.size()];
    arms.emplace_back(fmt::format("cell-{}", i + 1), model, payload_kg,
                      seed + static_cast<std::uint64_t>(i));
  }
  return arms;
}

BadBatch bad_batch(const Arm& arm, int week, int which, std::uint64_t seed) {
  BadBatch bad{"", arm.measured(arm.poses(60, seed), week, seed, false)};
  std::vector<Measurement>& rows = bad.batch.measurements;
  Draw draw(seed);
  switch (which % 4) {
    case 0:
      bad.what = "in inches";
      for (Measurement& m : rows) m.p_W /= 25.4;
      break;
    case 1:
      bad.what = "its measurements slipped by a row";
      for (std::size_t i = 0; i + 1 < rows.size(); ++i) std::swap(rows[i].p_W, rows[i + 1].p_W);
      break;
    case 2:
      bad.what = "its tracker was knocked by 0.4 mm in the middle";
      for (std::size_t i = rows.size() / 2; i < rows.size(); ++i)
        rows[i].p_W += Vector3(3e-4, -2e-4, 2e-4);
      break;
    default:
      bad.what = "five times as noisy";
      for (Measurement& m : rows)
        m.p_W += 5 * kSigma * Vector3(draw.normal(), draw.normal(), draw.normal());
  }
  return bad;
}

}  // namespace trammel::year
