// Checks the radius that a model's page promises for 95 % of fresh poses: 40 arms drawn
// anew, each trained by itself and judged without noise on poses that nobody measured. The
// tracker's true sigma is drawn within 10 % of the stated one; every second arm has a gear that its
// model is not told of, so that the bias has something to learn.
// --models N: less of it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <random>

#include "server/base/units.h"
#include "server/compensate/accuracy.h"
#include "server/plan/plan.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

constexpr int kFresh = 400;  // poses that judge a model

struct Case {
  VirtualRobot robot;
  int poses = 0;
  double held_out = 0;
  std::string bias;
  std::string kind;
};

/// An arm whose errors are those of the shipped one times -2 to 2, and a tracker that is not quite
/// as stated.
Case drawn_case(const std::shared_ptr<const Cell>& cell, int number) {
  std::mt19937_64 random(static_cast<std::uint64_t>(number) * 2654435761u + 17);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(random);
  };
  Case one{test::chapter_5_robot(cell), 60 + 20 * (number % 8), number % 3 == 0 ? 0.0 : 0.2, "auto",
           "as modelled"};
  PhysicalModel& truth = one.robot.truth;
  const std::vector<Parameter> parameters = truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    double& value = truth.values(static_cast<Eigen::Index>(k));
    value *= uniform(0.5, 2) * (random() % 2 == 1 && parameters[k].lower < 0 ? -1 : 1);
  }
  if (number % 2 == 1) {
    const int joint = 1 + static_cast<int>(random() % 3);
    PhysicalModel geared = test::demand(make_physical_model(
        cell, {"base", "geometry", "compliance",
               fmt::format("gear_transmission:{}@{}", joint, number % 4 == 1 ? 2 : 5)}));
    const Eigen::Index known = truth.values.size();
    geared.values = geared.prior_values();
    geared.values.head(known) = truth.values;
    for (Eigen::Index k = known; k < geared.values.size(); ++k)
      if (!geared.parameters()[static_cast<std::size_t>(k)].is_place)
        geared.values(k) = uniform(-4e-5, 4e-5);
    truth = geared;
    one.kind = "a gear untold";
  }
  one.robot.sigma *= uniform(0.9, 1.1);
  return one;
}

/// Share of fresh poses in the domain that are within `radius` of where the model says.
double share_within(const CompensatedModel& model, const VirtualRobot& robot, double radius,
                    std::uint64_t seed) {
  const Cell& cell = *robot.truth.cell;
  const Eigen::MatrixXd q = test::demand(plan_poses(cell, {kFresh, seed}));
  SimulateOptions exact;
  exact.noise = false;
  const MeasurementBatch truth =
      test::demand(check_against_cell(test::demand(simulate(robot, q, exact)), cell)).rows();
  const CompensatedModel::LevelErrors errors = model.errors_B(truth);
  int inside = 0, asked = 0;
  for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i) {
    if (!errors.in_domain[static_cast<std::size_t>(i)]) continue;
    ++asked;
    if (errors.compensated.col(i).norm() <= radius) ++inside;
  }
  return static_cast<double>(inside) / asked;
}

void promised(int models) {
  const auto cell = test::cell_7();
  std::vector<double> shares;
  double least = 1;
  for (int number = 1; number <= models; ++number) {
    const Case one = drawn_case(cell, number);
    const auto seed = static_cast<std::uint64_t>(1000 + number);
    const MeasurementBatch batch = test::measured(one.robot, one.poses, seed);
    TrainOptions options;
    options.bias = one.bias;
    const CompensatedModel model = test::demand(train(
        cell, test::demand(check_against_cell(batch, *cell, drawn(one.held_out, seed))), options));
    const PositionAccuracy accuracy = *PositionAccuracy::of(model);
    const double radius = accuracy.at(PositionAccuracy::kShare);
    shares.push_back(share_within(model, one.robot, radius, 77000 + seed));
    least = std::min(least, shares.back());
    fmt::print(
        "  model {:2}: {:3} poses, {}, bias {}: {:.4f} mm ({:.4f} to {:.4f}), right at {:.1f} %\n",
        number, one.poses, one.kind, model.parts().bias ? model.parts().bias->kernel : "none",
        to_mm(radius), to_mm(accuracy.least()), to_mm(accuracy.most()), 100 * shares.back());
    std::fflush(stdout);
  }
  double sum = 0;
  for (const double share : shares) sum += share;
  fmt::print(
      "figure promised 95 % right on fresh poses, mean of {} models, %: {:.1f} (aim 93 to 97)\n",
      models, 100 * sum / static_cast<double>(models));
  fmt::print("figure promised 95 % right on fresh poses, worst model, %: {:.1f}\n", 100 * least);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("Whether what a model's page promises is right");
  int models = 40;
  app.add_option("--models", models, "drawn anew");
  CLI11_PARSE(app, argc, argv);
  trammel::promised(models);
}
