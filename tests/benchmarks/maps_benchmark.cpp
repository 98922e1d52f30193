// Maps of the joints whose spectra nobody tells, on arms of the second simulation whose masses
// nobody tells either, and on the measured UR10. `maps_benchmark [--only
// falling|flat|single|none|ur10] [--seeds N] [--poses N]`.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/units.h"
#include "server/calibrate/calibrate_with_maps.h"
#include "server/error_sources/joint_map.h"
#include "server/measurement/checked_batch.h"
#include "server/robot/cell_file.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/heavy_arm.h"

namespace trammel {
namespace {

using test::demand;
using test::tell_figure;

struct Options {
  std::string only;
  int seeds = 2;
  int poses = 600;
};

constexpr int kFinest = 100;  // harmonic
constexpr double kNoise_mm = 0.013;

double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Standard deviation of sine and cosine of a harmonic, rad.
using Spectrum = double (*)(int joint, int harmonic);

double falling(int joint, int harmonic) {
  return harmonic > kFinest ? 0 : (joint < 3 ? 1e-4 : 6e-5) / harmonic;
}
double flat(int joint, int harmonic) { return harmonic > kFinest ? 0 : (joint < 3 ? 1e-5 : 6e-6); }
double single(int /*joint*/, int harmonic) { return harmonic == kFinest + 1 ? 6e-5 : 0; }
double none(int /*joint*/, int /*harmonic*/) { return 0; }

/// Each joint off by a random series of its own angle.
hidden::Effect maps(Spectrum spectrum, std::uint64_t seed) {
  hidden::Random random(seed * 31 + 5);
  std::vector<std::vector<double>> series(hidden::kJoints);
  for (int j = 0; j < static_cast<int>(series.size()); ++j) {
    for (int h = 1; h <= kFinest + 1; ++h) {
      for (int k = 0; k < 2; ++k)
        series[static_cast<std::size_t>(j)].push_back(spectrum(j, h) * hidden::normal(random));
    }
  }
  hidden::Effect effect;
  effect.cause.cause = "joint_map";
  effect.act = [series](const hidden::MeasuringPose& pose, const Eigen::VectorXd&,
                        hidden::Moment& moment) {
    for (Eigen::Index j = 0; j < moment.q.size(); ++j) {
      const std::vector<double>& one = series[static_cast<std::size_t>(j)];
      for (std::size_t k = 0; k < one.size(); k += 2) {
        const double angle = static_cast<double>(k / 2 + 1) * pose.q(j);
        moment.q(j) += one[k] * std::sin(angle) + one[k + 1] * std::cos(angle);
      }
    }
  };
  return effect;
}

struct Missed {
  double held_out_mm = 0, coverage = 0, seconds = 0;
};

/// `coverage`: of the coordinates of the held-out poses, measured ones.
Missed missed(const Result<CalibrationResult>& result, const MeasurementBatch& batch) {
  const CalibrationResult& found = demand(result);
  const MeasurementBatch here = aligned(batch, found.sessions, found.model.cell->tracker);
  double square = 0, inside = 0;
  const double noise = std::hypot(found.model.cell->tracker.sigma, found.discrepancy);
  for (const Measurement& m : here.measurements) {
    Eigen::MatrixXd J;
    const Vector3 off = m.p_W - found.model.pose_W(m.context, found.model.values, &J).translation();
    square += off.squaredNorm();
    const Eigen::MatrixXd along = J.topRows<3>();
    const Vector3 variance = (along * found.covariance).cwiseProduct(along).rowwise().sum();
    for (Eigen::Index k = 0; k < 3; ++k)
      inside += std::abs(off(k)) < 1.96 * std::sqrt(variance(k) + noise * noise);
  }
  const auto count = static_cast<double>(here.measurements.size());
  return {to_mm(std::sqrt(square / count)), 100 * inside / (3 * count), 0};
}

std::vector<std::string> with_maps(const std::string& behind) {
  std::vector<std::string> sources = {"base", "geometry", "compliance"};
  for (int joint = 1; joint <= 6; ++joint)
    sources.push_back(fmt::format("joint_map:{}{}", joint, behind));
  return sources;
}

/// Maps whose spectra are told.
std::vector<std::string> told(Spectrum spectrum) {
  std::vector<std::string> sources = {"base", "geometry", "compliance"};
  constexpr double kLow = 0.01;  // a knee from which all harmonics fall
  for (int j = 0; j < 6; ++j) {
    if (spectrum == &falling)
      sources.push_back(spelled_map(
          j, {.harmonics = kFinest, .amplitude = falling(j, 1) / kLow, .knee = kLow, .power = 1}));
    if (spectrum == &flat)
      sources.push_back(spelled_map(
          j, {.harmonics = kFinest, .amplitude = flat(j, 1), .knee = 9999, .power = 1}));
  }
  return sources;
}

void report(const std::string& name, const std::string& which, const Missed& by) {
  tell_figure(fmt::format("maps {}, {}, mm", name, which), by.held_out_mm);
  tell_figure(fmt::format("maps {}, {}, inside 95 %", name, which), by.coverage);
  tell_figure(fmt::format("maps {}, {}, processor s", name, which), by.seconds);
}

void drawn_arms(const Options& options, const std::string& name, Spectrum spectrum) {
  if (!options.only.empty() && options.only != name) return;
  const CalibrateOptions weigh{.held = {}, .weigh_links = true};
  for (int seed = 1; seed <= options.seeds; ++seed) {
    test::HeavyArm arm = test::draw_heavy_arm({.seed = static_cast<std::uint64_t>(seed)});
    arm.world.effects = {maps(spectrum, static_cast<std::uint64_t>(seed))};
    const MeasurementBatch batch = test::measured(arm, options.poses, 1);
    const MeasurementBatch fresh = test::measured(arm, 1000, 2);
    const auto tell = [&](const std::string& which, const Result<CalibrationResult>& found,
                          double begin) {
      Missed by = missed(found, fresh);
      by.seconds = seconds() - begin;
      report(fmt::format("{} {} #{}", name, options.poses, seed), which, by);
      for (const ErrorSourcePtr& source : found->model.sources) {
        if (source->name().starts_with("joint_map")) std::printf("  %s\n", source->name().c_str());
      }
    };
    double begin = seconds();
    tell("learned", calibrate_with_maps(arm.cell, with_maps(""), batch, weigh), begin);
    begin = seconds();
    tell("told", calibrate(arm.cell, told(spectrum), batch, weigh), begin);
    begin = seconds();
    tell("fixed", calibrate(arm.cell, with_maps("@48"), batch, weigh), begin);
  }
  tell_figure("maps, sigma times root of 3, mm", kNoise_mm * std::sqrt(3.0));
}

const std::string kData = std::string(TRAMMEL_SOURCE_DIR) + "/../shared/data/ur10_series_";

/// The rows whose ids end in 7, 8 and 9, or the first `most` of the others.
MeasurementBatch series(const Cell& cell, const std::string& name, bool held_out,
                        std::size_t most = 1 << 30) {
  MeasurementBatch batch =
      demand(check_against_cell(demand(read_batch_csv(kData + name + ".csv")), cell)).rows();
  std::erase_if(batch.measurements,
                [&](const Measurement& m) { return (std::stoi(m.pose_id) % 10 >= 7) != held_out; });
  if (batch.measurements.size() > most) batch.measurements.resize(most);
  return batch;
}

void measured_ur10(const Options& options) {
  if (!options.only.empty() && !options.only.starts_with("ur10")) return;
  if (!std::filesystem::exists(kData + "c.csv")) return;
  const auto cell = std::make_shared<const Cell>(
      demand(read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/ur10.yaml")));
  const auto ask = [&](const std::string& name, std::size_t most) {
    const double begin = seconds();
    const auto found = calibrate_with_maps(cell, with_maps(""), series(*cell, name, false, most),
                                           {.held = {}, .weigh_links = true});
    Missed by = missed(found, series(*cell, name, true));
    by.seconds = seconds() - begin;
    std::printf("  discrepancy %.5f mm %.6f mrad\n", 1e3 * found->discrepancy,
                1e3 * found->discrepancy_rotation);
    report(fmt::format("UR10 {}{}", name, most < 1000 ? fmt::format(" {} poses", most) : ""),
           "learned", by);
    for (const ErrorSourcePtr& source : found->model.sources)
      std::printf("  %s\n", source->name().c_str());
  };
  if (options.only != "ur10 d" && options.only != "ur10 c") ask("c", 200);
  if (options.only != "ur10 200" && options.only != "ur10 c") ask("d", 1 << 30);
  if (options.only != "ur10 200" && options.only != "ur10 d") ask("c", 1 << 30);
}

Options options_of(int argc, char** argv) {
  Options options;
  for (int k = 1; k + 1 < argc; k += 2) {
    if (std::strcmp(argv[k], "--only") == 0) options.only = argv[k + 1];
    if (std::strcmp(argv[k], "--seeds") == 0) options.seeds = std::atoi(argv[k + 1]);
    if (std::strcmp(argv[k], "--poses") == 0) options.poses = std::atoi(argv[k + 1]);
  }
  return options;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  const trammel::Options options = trammel::options_of(argc, argv);
  trammel::drawn_arms(options, "falling", trammel::falling);
  trammel::drawn_arms(options, "flat", trammel::flat);
  trammel::drawn_arms(options, "single", trammel::single);
  trammel::drawn_arms(options, "none", trammel::none);
  trammel::measured_ur10(options);
}
