// The figures that calibration answers for, printed beside their aims: honest uncertainties,
// validation error, a robot like the measured one, and the time of a fit beside SciPy's
// Levenberg-Marquardt (vectorised NumPy) on the same batch. `calibrate_benchmark [SEEDS]`.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/refit.h"
#include "server/plan/plan.h"
#include "tests/support/demand.h"
#include "tests/support/gauged_arm.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double rms_mm(const PhysicalModel& model, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements)
    sum += (m.p_W - model.pose_W(m.context).translation()).squaredNorm();
  return to_mm(std::sqrt(sum / static_cast<double>(batch.measurements.size())));
}

/// Random poses with every joint approached from a random side, as the robot's own course runs.
MeasurementBatch both_sides(const VirtualRobot& robot, int count, std::uint64_t seed) {
  const Cell& cell = *robot.truth.cell;
  const Eigen::MatrixXd q = latin_hypercube(test::demand(planning_ranges(cell)), count, seed);
  std::mt19937_64 random(seed);
  std::vector<PoseContext> poses(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    PoseContext& pose = poses[static_cast<std::size_t>(i)];
    pose.q = q.row(i).transpose();
    for (int j = 0; j < cell.robot.size(); ++j)
      pose.direction.push_back(random() % 2 == 0 ? 1 : -1);
  }
  SimulateOptions options;
  options.seed = seed + 1;
  MeasurementBatch batch = test::demand(simulate(robot, poses, options));
  batch.id = "both-sides";
  return batch;
}

/// The number of identifiable directions within U(k=2) of the truth.
struct Coverage {
  int inside = 0, all = 0;
};

Coverage coverage_of(const CalibrationResult& result, const PhysicalModel& truth) {
  const auto P = static_cast<Eigen::Index>(result.parameters.size());
  Eigen::VectorXd scale(P);
  for (Eigen::Index i = 0; i < P; ++i)
    scale(i) = result.parameters[static_cast<std::size_t>(i)].parameter.prior_scale;
  const Eigen::VectorXd inverse = scale.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(inverse.asDiagonal() * result.covariance * inverse.asDiagonal()));
  const Eigen::VectorXd error = (result.model.values - truth.values).cwiseProduct(inverse);
  Coverage coverage;
  for (Eigen::Index k = 0; k < P; ++k) {
    if (eigen.eigenvalues()(k) > 0.5) continue;  // the prior's, not the data's
    ++coverage.all;
    coverage.inside +=
        std::abs(eigen.eigenvectors().col(k).dot(error)) <= 2 * std::sqrt(eigen.eigenvalues()(k))
            ? 1
            : 0;
  }
  return coverage;
}

MeasurementBatch positions_alone(MeasurementBatch batch) {
  for (Measurement& m : batch.measurements) m.R_WT.reset();
  return batch;
}

void uncertainties_and_validation(int seeds) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  Coverage coverage;
  double validation = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto s = static_cast<std::uint64_t>(seed);
    const CalibrationResult result = test::demand(calibrate(
        cell, {"base", "geometry", "compliance_linear"}, test::measured(robot, 120, 100 + s), {}));
    const Coverage one = coverage_of(result, robot.truth);
    coverage.inside += one.inside;
    coverage.all += one.all;
    if (seed <= 20) validation += rms_mm(result.model, test::measured(robot, 1000, 9000 + s)) / 20;
  }
  std::printf("identifiable directions within U(k=2), %d seeds: %.2f %% of %d (aim 93 to 98 %%)\n",
              seeds, 100.0 * coverage.inside / coverage.all, coverage.all);
  std::printf("M3, 120 poses, validation rms, mean of 20 seeds: %.5f mm (aim 0.0237)\n",
              validation);
}

void robot_like_the_measured_one() {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::demand(
      read_virtual_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/truth/chapter-6.yaml", cell));
  const CalibrationResult result = test::demand(calibrate(
      cell,
      {"base", "geometry", "compliance", "thermal_growth", "gear_transmission:1",
       "gear_transmission:2", "gear_transmission:3", "gear_transmission:4", "gear_transmission:5",
       "backlash:1", "backlash:2", "backlash:3", "link_bending:2", "link_bending:4"},
      both_sides(robot, 600, 1), {}));
  std::printf(
      "chapter-6-like robot, 600 poses, orders not told, validation rms: %.5f mm (aim %.5f)\n",
      rms_mm(result.model, both_sides(robot, 1000, 3)), 1.05 * 0.013 * std::sqrt(3.0));
}

void speed_beside_scipy() {
  const auto cell = test::cell_7();
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 1000, 77);
  const double begin = cpu_seconds();
  const CalibrationResult result =
      test::demand(calibrate(cell, {"base", "geometry", "compliance_linear"}, batch, {}));
  const double ours = cpu_seconds() - begin;
  std::printf("1000 poses, 36 parameters: %.3f s, residual rms %.5f mm\n", ours, to_mm(result.rms));
  const test::TemporaryFolder folder;
  const std::string csv = folder.write("batch.csv", to_csv(batch));
  std::fflush(stdout);
  const std::string command = fmt::format(
      "OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 /usr/bin/python3 "
      "{}/tests/benchmarks/calibrate_scipy.py {} {}",
      TRAMMEL_SOURCE_DIR, csv, ours);
  if (std::system(command.c_str()) != 0)
    std::printf("SciPy is not at hand (Debian: python3-scipy)\n");
}

/// Base and tool from 60 poses, beside maps of all joints that stay as they are.
void refit_beside_maps() {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  std::vector<std::string> sources = {"base", "geometry", "compliance_linear", "tool"};
  for (int joint = 1; joint <= 6; ++joint) sources.push_back(fmt::format("joint_map:{}@78", joint));
  const CalibrationResult known =
      test::demand(calibrate(cell, sources, test::measured(robot, 600, 78), {}));
  const MeasurementBatch batch = test::measured(robot, 60, 79);
  const double begin = cpu_seconds();
  const Refit found = test::demand(refit(known, cell, batch, {"base", "tool"}));
  std::printf("base and tool from 60 poses beside %zu parameters: %.3f s (aim 1), rms %.5f mm\n",
              found.result.parameters.size(), cpu_seconds() - begin, to_mm(found.result.rms));
}

/// Arms whose links weigh, without a data sheet.
void self_weight(int seeds) {
  double worst = 0;
  double longest = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const test::HeavyArm arm = test::draw_heavy_arm({.seed = static_cast<std::uint64_t>(seed)});
    const MeasurementBatch batch = test::measured(arm, 600, 1);
    const double begin = cpu_seconds();
    const CalibrationResult found = test::demand(calibrate(
        arm.cell, {"base", "geometry", "compliance"}, batch, {.held = {}, .weigh_links = true}));
    longest = std::max(longest, cpu_seconds() - begin);
    worst = std::max(worst, rms_mm(found.model, test::measured(arm, 1000, 2)));
  }
  std::printf(
      "masses never told, 600 poses, worst of %d arms: %.5f mm (aim %.5f), longest %.2f s\n", seeds,
      worst, 1.05 * 0.013 * std::sqrt(3.0), longest);
}

/// As many positions as 1000 poses with three reflectors have: the controller compensates the
/// links' weights, or not.
void weights_of_many_positions() {
  double longest = 0;
  const auto ask = [&](const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch) {
    const double begin = cpu_seconds();
    const CalibrationResult found =
        test::demand(calibrate(cell, {"base", "geometry", "compliance"}, positions_alone(batch),
                               {.held = {}, .weigh_links = true}));
    longest = std::max(longest, cpu_seconds() - begin);
    std::printf("  %zu positions, %d iterations: %.2f s\n", batch.measurements.size(),
                found.iterations, cpu_seconds() - begin);
  };
  ask(test::cell_7(), test::measured(test::chapter_5_robot(test::cell_7()), 3000, 5));
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const test::HeavyArm arm =
        test::draw_heavy_arm({.seed = seed, .payloads = static_cast<int>(seed % 3)});
    ask(arm.cell, test::measured(arm, 3000, 1));
  }
  std::printf("3000 positions, masses never told, longest: %.2f s\n", longest);
}

/// Draw wires to three anchors, 200 distances, beside the Cramér-Rao bound and 200 positions of the
/// same sigma.
void draw_wires(int seeds) {
  constexpr double kSigma = 0.05;  // mm
  const auto anchors = test::three_corners();
  for (const bool known : {true, false}) {
    double missed = 0, least = 0, by_positions = 0;
    for (int k = 1; k <= seeds; ++k) {
      const auto seed = static_cast<std::uint64_t>(k);
      const test::GaugedArm arm =
          test::gauged_arm(seed, anchors, known ? "" : test::unknown_places(anchors));
      const auto rows = test::wire_rows(arm, 200, seed);
      const auto found = [&](const std::vector<test::GaugeRow>& of) {
        return test::demand(calibrate(arm.cell, {"base", "geometry", "compliance"},
                                      test::gauge_batch(arm, of, kSigma, seed), {}));
      };
      missed += std::pow(test::volumetric_mm(arm, found(rows), !known, 1000 + seed), 2);
      least +=
          std::pow(test::least_volumetric_mm(arm, rows, kSigma, known, !known, 1000 + seed), 2);
      by_positions += std::pow(
          test::volumetric_mm(arm, found(test::position_rows(arm, 200, seed)), !known, 1000 + seed),
          2);
    }
    std::printf(
        "200 distances to %s anchors, rms over the bound: %.3f (aim 1.1), over 200 positions: %.3f "
        "(aim 2.5)\n",
        known ? "known" : "unknown", std::sqrt(missed / least), std::sqrt(missed / by_positions));
  }
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  if (argc > 1 && std::string(argv[1]) == "weights") {
    trammel::weights_of_many_positions();
    return 0;
  }
  trammel::weights_of_many_positions();
  trammel::uncertainties_and_validation(argc > 1 ? std::atoi(argv[1]) : 100);
  trammel::robot_like_the_measured_one();
  trammel::speed_beside_scipy();
  trammel::refit_beside_maps();
  trammel::self_weight(20);
  trammel::draw_wires(20);
}
