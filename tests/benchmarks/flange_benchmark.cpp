// Reflectors on one flange, and whether 95 % intervals hold 95 %, on drawn arms of the second
// simulation. `flange_benchmark [--only fourth|coverage|ur10|speed] [--seeds N] [--poses N] [--bias
// KERNEL]`; with --poses coverage of that many poses alone.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/check.h"
#include "server/measurement/files/batch_file.h"
#include "server/robot/cell_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/hidden_check.h"

namespace trammel {
namespace {

using hidden::MeasuringPose;
using hidden::Random;
using hidden::World;
using test::demand;
using test::tell_figure;

struct Options {
  std::string only;
  int seeds = 12;
  int poses = 200;
  std::string bias = "auto";
  bool poses_asked = false;
};

constexpr double kWave = 2.5e-4;    // rad: with it the physics leaves some tenths of a millimetre
constexpr double kWobble = 2.5e-4;  // rad
constexpr int kFourth = 3;

double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

Eigen::Matrix4d reflector(double x_mm, double y_mm, double z_mm) {
  Eigen::Matrix4d frame = Eigen::Matrix4d::Identity();
  frame.block<3, 1>(0, 3) = Eigen::Vector3d(x_mm, y_mm, z_mm);
  return frame;
}

/// An arm with what no error source explains, and four reflectors on its flange.
World drawn_world(std::uint64_t seed) {
  hidden::TrainedRobot robot =
      hidden::draw_robot({.seed = seed, .poses = 30, .orientation = false});
  World world = robot.world;
  world.tools = {reflector(120, 10, 60), reflector(-70, 110, 90), reflector(-60, -115, 40),
                 reflector(60, -90, 260)};
  Random random(seed * 7919 + 3);
  const hidden::Scene scene{world.arm, &world.poses};
  world.effects = {hidden::draw_foreign_effect("foreign_wave", scene, random),
                   hidden::draw_effect({"axis_runout", 4, "", -1, {}}, scene, random)};
  world.effects[0].values *= kWave / 1e-4;
  world.effects[1].values *= kWobble / 1e-4;
  return world;
}

std::vector<MeasuringPose> scattered(int count, std::uint64_t seed) {
  Random random(seed);
  hidden::PosePlan plan;
  plan.count = count;
  plan.ranges = "6dim-l";
  plan.constant_temperature = true;
  return draw_poses(plan, random);
}

/// Every pose with each of these reflectors.
std::vector<MeasuringPose> with_reflectors(const std::vector<MeasuringPose>& poses,
                                           const std::vector<int>& reflectors) {
  std::vector<MeasuringPose> all;
  for (const MeasuringPose& pose : poses) {
    for (const int reflector : reflectors) {
      all.push_back(pose);
      all.back().tool = reflector;
      all.back().load = 0;
      all.back().index = static_cast<int>(all.size()) - 1;
      all.back().time_s = 2.0 * static_cast<double>(all.size());
    }
  }
  return all;
}

CompensatedModel trained(World world, const std::vector<MeasuringPose>& poses,
                         const std::string& bias, std::uint64_t seed) {
  world.poses = poses;
  Random random(seed * 104729 + 11);
  hidden::Frames frames = frames_at(world, poses, world.effects);
  for (Eigen::Matrix4d& frame : frames) {
    for (int axis = 0; axis < 3; ++axis) frame(axis, 3) += world.sigma_mm * hidden::normal(random);
  }
  const std::string cell_yaml = cell_text(world, {world.tools, world.loads}, "6dim-l");
  const auto cell = std::make_shared<const Cell>(
      demand(parse_cell(cell_yaml, hidden::robot_text(), "cell.yaml")));
  const CheckedBatch batch = demand(check_against_cell(
      demand(parse_batch_csv(batch_text(world, frames), "batch.csv")), *cell, drawn(0, 1)));
  TrainOptions options;
  options.bias = bias;
  return demand(train(cell, batch, options));
}

/// The true error of one reflector at poses never measured.
struct Fresh {
  double rms_mm = 0;
  double inside = 0;  // share of coordinates inside their 95 %
  double in_domain = 0;
};
Fresh fresh_errors(const World& world, const CompensatedModel& model, int reflector,
                   std::uint64_t seed) {
  const std::vector<MeasuringPose> poses =
      with_reflectors(scattered(400, seed + 500000), {reflector});
  const hidden::Frames real = frames_at(world, poses, world.effects);
  std::vector<PoseContext> asked(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    asked[i].q = poses[i].q;
    asked[i].tool = "tool-" + std::to_string(reflector + 1);
    asked[i].payload = "load-1";
    asked[i].served = true;
  }
  const std::vector<ErrorPrediction> predictions = model.predict_all(asked);
  Fresh fresh;
  const auto count = static_cast<double>(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d missed_mm =
        real[i].block<3, 1>(0, 3) - 1e3 * predictions[i].X_BT_predicted.translation();
    fresh.rms_mm += missed_mm.squaredNorm() / count;
    const Eigen::Array3d z = missed_mm.array().abs() / (1e3 * predictions[i].true_stddev_B.array());
    fresh.inside += static_cast<double>((z < 1.96).count()) / (3 * count);
    fresh.in_domain += predictions[i].in_domain / count;
  }
  fresh.rms_mm = std::sqrt(fresh.rms_mm);
  return fresh;
}

void fourth(const Options& options) {
  double worst = 0, mean = 0, inside = 0, plain = 0;
  std::printf("%6s %14s %14s %10s %10s %10s %s\n", "seed", "three, mm", "its own, mm", "ratio",
              "plain, mm", "inside %", "in domain %");
  for (int seed = 1; seed <= options.seeds; ++seed) {
    const auto s = static_cast<std::uint64_t>(seed);
    const World world = drawn_world(s);
    const std::vector<MeasuringPose> poses = scattered(options.poses, s);
    const CompensatedModel three =
        trained(world, with_reflectors(poses, {0, 1, 2}), "se + flange", s);
    const CompensatedModel own = trained(world, with_reflectors(poses, {kFourth}), "se", s + 1000);
    const CompensatedModel without = trained(world, with_reflectors(poses, {0, 1, 2}), "se", s);
    const Fresh of_three = fresh_errors(world, three, kFourth, s);
    const Fresh of_own = fresh_errors(world, own, kFourth, s);
    const double ratio = of_three.rms_mm / of_own.rms_mm;
    std::printf("%6d %14.4f %14.4f %10.3f %10.4f %10.1f %.1f\n", seed, of_three.rms_mm,
                of_own.rms_mm, ratio, fresh_errors(world, without, kFourth, s).rms_mm,
                100 * of_three.inside, 100 * of_three.in_domain);
    worst = std::max(worst, ratio);
    mean += ratio / options.seeds;
    inside += 100 * of_three.inside / options.seeds;
    plain += fresh_errors(world, without, 0, s).rms_mm / fresh_errors(world, three, 0, s).rms_mm /
             options.seeds;
  }
  tell_figure("a fourth reflector by three others over its own training, mean", mean);
  tell_figure("a fourth reflector by three others over its own training, worst", worst);
  tell_figure("a fourth reflector, true error inside 95 %, %", inside);
  tell_figure("a measured reflector, plain kernel over flange, mean", plain);
}

// Each model: trained with few poses, asked at poses of the same ranges, tracker's noise left out.
void coverage(const Options& options) {
  for (const int poses :
       options.poses_asked ? std::vector<int>{options.poses} : std::vector<int>{20, 40, 60, 200}) {
    double inside = 0, least = 1;
    for (int seed = 1; seed <= options.seeds; ++seed) {
      const auto s = static_cast<std::uint64_t>(seed);
      const World world = drawn_world(s);
      const CompensatedModel model =
          trained(world, with_reflectors(scattered(poses, s + 77), {0}), options.bias, s + 2000);
      const Fresh fresh = fresh_errors(world, model, 0, s);
      const double share = fresh.inside;
      std::printf("%3d poses, seed %2d: %-12s %.4f mm, inside %5.1f %%, in domain %5.1f %%\n",
                  poses, seed, model.parts().bias ? model.parts().bias->kernel.c_str() : "none",
                  fresh.rms_mm, 100 * share, 100 * fresh.in_domain);
      inside += 100 * share / options.seeds;
      least = std::min(least, share);
    }
    tell_figure("models of " + std::to_string(poses) + " poses, true error inside 95 %, mean",
                inside);
    tell_figure("models of " + std::to_string(poses) + " poses, true error inside 95 %, least",
                100 * least);
  }
}

/// 95 % of the share inside, by runs of poses drawn with replacement: neighbours in time have
/// errors in common.
std::pair<double, double> block_bootstrap(const std::vector<double>& inside) {
  constexpr int kDraws = 4000;
  constexpr std::size_t kRun = 20;
  Random random(1);
  const std::size_t runs = (inside.size() + kRun - 1) / kRun;
  std::vector<double> means;
  for (int draw = 0; draw < kDraws; ++draw) {
    double sum = 0;
    for (std::size_t run = 0; run < runs; ++run) {
      const auto first =
          static_cast<std::size_t>(hidden::whole(random, 0, static_cast<int>(inside.size()) - 1));
      for (std::size_t i = 0; i < kRun; ++i) sum += inside[(first + i) % inside.size()];
    }
    means.push_back(sum / static_cast<double>(runs * kRun));
  }
  std::sort(means.begin(), means.end());
  return {means[kDraws / 40], means[kDraws - kDraws / 40]};
}

// Every pose whose id ends in 7, 8 or 9 is held out, as the tests do it.
void ur10(const Options&) {
  const auto cell =
      std::make_shared<const Cell>(demand(read_cell(TRAMMEL_SOURCE_DIR "/config/ur10.yaml")));
  for (const char* name : {"c", "d"}) {
    const std::string file =
        fmt::format(TRAMMEL_SOURCE_DIR "/../shared/data/ur10_series_{}.csv", name);
    if (!std::filesystem::exists(file)) continue;
    MeasurementBatch batch = demand(check_against_cell(demand(read_batch_csv(file)), *cell)).rows();
    MeasurementBatch held_out = batch;
    std::erase_if(held_out.measurements,
                  [](const Measurement& m) { return std::stoi(m.pose_id) % 10 < 7; });
    std::erase_if(batch.measurements,
                  [](const Measurement& m) { return std::stoi(m.pose_id) % 10 >= 7; });
    TrainOptions options;
    options.level = "M3";
    options.bias = "matern52 + joint_map + parameters";
    const CompensatedModel model =
        demand(train(cell, demand(check_against_cell(batch, *cell, drawn(0, 1))), options));
    const CompensatedModel::LevelErrors errors = model.errors_B(held_out);
    std::vector<double> inside;
    for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i) {
      const auto z = errors.compensated.col(i).array().abs() / errors.stddev.col(i).array();
      inside.push_back(static_cast<double>((z < 1.96).count()) / 3);
    }
    const auto limits = block_bootstrap(inside);
    double mean = 0;
    for (const double share : inside) mean += 100 * share / static_cast<double>(inside.size());
    tell_figure(fmt::format("UR10 {} held out inside 95 %", name), mean);
    tell_figure(fmt::format("UR10 {} held out inside 95 %, by blocks from", name),
                100 * limits.first);
    tell_figure(fmt::format("UR10 {} held out inside 95 %, by blocks to", name),
                100 * limits.second);
  }
}

void speed(const Options& options) {
  const World world = drawn_world(1);
  const std::vector<MeasuringPose> poses = scattered(options.poses, 1);
  for (const char* bias : {"se", "se + flange", "auto"}) {
    const double began = seconds();
    (void)trained(world, with_reflectors(poses, {0, 1, 2}), bias, 1);
    tell_figure(std::string("three reflectors, processor s, ") + bias, seconds() - began);
  }
}

int run(int argc, char** argv) {
  Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--only") == 0) options.only = argv[i + 1];
    if (std::strcmp(argv[i], "--seeds") == 0) options.seeds = std::stoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--bias") == 0) options.bias = argv[i + 1];
    if (std::strcmp(argv[i], "--poses") == 0) {
      options.poses = std::stoi(argv[i + 1]);
      options.poses_asked = true;
    }
  }
  const auto asked = [&](const char* name) { return options.only.empty() || options.only == name; };
  if (asked("fourth")) fourth(options);
  if (asked("coverage")) coverage(options);
  if (asked("ur10")) ur10(options);
  if (asked("speed")) speed(options);
  return 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) { return trammel::run(argc, argv); }
