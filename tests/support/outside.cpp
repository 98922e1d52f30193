#include "tests/support/outside.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/coverage.h"
#include "server/tasks/train/leftover.h"
#include "tests/support/demand.h"
#include "tests/support/from_rows.h"

namespace trammel::test {

namespace {

constexpr double kBeyondKnown = 3;
constexpr int kAsked = 300;  // at each widening
constexpr std::array kWidenings = {1.0, 1.2, 1.6, 2.4, 4.0, 100.0};
constexpr std::array kBands = {0.0, 0.1, 0.3, 1.0, 100.0};  // of a range

JointRanges widened(const JointRanges& ranges, const JointRanges& limits, double factor) {
  JointRanges wide = ranges;
  for (std::size_t j = 0; j < wide.size(); ++j) {
    const double middle = (ranges[j].first + ranges[j].second) / 2;
    const double half = factor * (ranges[j].second - ranges[j].first) / 2;
    wide[j] = {std::max(limits[j].first, middle - half), std::min(limits[j].second, middle + half)};
  }
  return wide;
}

double farthest(const JointVector& q, const JointRanges& ranges) {
  double distance = 0;
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    const auto& [low, high] = ranges[j];
    const double angle = q(static_cast<Eigen::Index>(j));
    distance = std::max(distance, std::max(low - angle, angle - high) / (high - low));
  }
  return distance;
}

/// m, Euclidean, that the whole bias misses each pose by, in domain or not.
Eigen::VectorXd missed(const CompensatedModel& model, const MeasurementBatch& asked) {
  const BiasProblem problem = leftover(model.parts().physics, asked);
  std::vector<BiasFeatures> features;
  for (const Measurement& m : asked.measurements) {
    if (model.bias()->needs_features()) features.push_back(model.features(m.context));
  }
  return (problem.residual_B - model.bias()->mean_all_B(problem.q, features)).rowwise().norm();
}

}  // namespace

MeasurementBatch measured_within(const VirtualRobot& robot, const JointRanges& ranges, int poses,
                                 std::uint64_t seed) {
  SimulateOptions options;
  options.seed = seed;
  MeasurementBatch batch = demand(simulate(robot, latin_hypercube(ranges, poses, seed), options));
  batch.id = "within";
  return batch;
}

OutsideFigures asked_outside(const VirtualRobot& robot, const JointRanges& ranges,
                             const std::string& level, const std::string& bias_name,
                             int training_poses, int seeds) {
  OutsideFigures figures;
  figures.bands.push_back({});
  for (std::size_t b = 1; b < kBands.size(); ++b)
    figures.bands.push_back({kBands[b - 1], kBands[b]});
  const JointRanges limits = demand(planning_ranges(*robot.truth.cell));
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto draw = static_cast<std::uint64_t>(100 * seed);
    TrainOptions options;
    options.level = level;
    options.bias = bias_name;
    options.seed = static_cast<std::uint64_t>(seed);
    const CompensatedModel model = demand(
        train(robot.truth.cell, measured_within(robot, ranges, training_poses, draw), options));
    for (std::size_t w = 0; w < kWidenings.size(); ++w) {
      const MeasurementBatch asked =
          measured_within(robot, widened(ranges, limits, kWidenings[w]), kAsked, draw + w + 1);
      const CompensatedModel::LevelErrors errors = model.errors_B(asked);
      const Eigen::VectorXd distance = missed(model, asked);
      for (Eigen::Index i = 0; i < distance.size(); ++i) {
        const auto row = static_cast<std::size_t>(i);
        const double out = farthest(asked.measurements[row].context.q, ranges);
        const bool beyond_known =
            distance(i) > kBeyondKnown * model.bias()->report().leave_one_out_rms;
        if (beyond_known) ++figures.outsiders;
        if (beyond_known && !errors.in_domain[row]) ++figures.caught;
        if (!beyond_known && out <= 0) ++figures.insiders;
        if (!beyond_known && out <= 0 && !errors.in_domain[row]) ++figures.refused;
        for (OutsideBand& band : figures.bands) {
          const bool inside = band.to == 0 ? out <= 0 : out > band.from && out <= band.to;
          if (!inside) continue;
          ++band.poses;
          const auto e = errors.compensated.col(i).array();
          const auto s = errors.stddev.col(i).array();
          band.rms += e.square().mean();
          band.stddev += s.square().mean();
          band.coverage_95 += (e.abs() <= kInterval95 * s).cast<double>().mean();
          const CompensatedModel::LevelErrors::Rotations& turns = errors.rotation;
          if (turns.stddev.cols() != distance.size()) continue;
          const auto r = turns.compensated.col(i).array();
          band.rotation_coverage_95 +=
              (r.abs() <= kInterval95 * turns.stddev.col(i).array()).cast<double>().mean();
        }
      }
    }
  }
  for (OutsideBand& band : figures.bands) {
    band.rms = std::sqrt(band.rms / band.poses);
    band.stddev = std::sqrt(band.stddev / band.poses);
    band.coverage_95 /= band.poses;
    band.rotation_coverage_95 /= band.poses;
  }
  return figures;
}

}  // namespace trammel::test
