#include "tests/support/virtual_cell.h"

#include <memory>
#include <random>

#include "server/simulate/simulate.h"
#include "tests/support/demand.h"

namespace trammel::test {
namespace {

std::shared_ptr<const Cell> shipped_cell() {
  return std::make_shared<const Cell>(demand(read_cell(shipped_cell_file())));
}

Eigen::MatrixXd draw_joints(const Cell& cell, int poses, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(0.05, 0.95);
  Eigen::MatrixXd q(poses, cell.robot.size());
  for (Eigen::Index row = 0; row < q.rows(); ++row) {
    for (Eigen::Index i = 0; i < q.cols(); ++i) {
      const auto [lower, upper] = cell.joint_ranges[static_cast<std::size_t>(i)];
      q(row, i) = lower + share(random) * (upper - lower);
    }
  }
  return q;
}

}  // namespace

std::string shipped_cell_file() { return TRAMMEL_SOURCE_DIR "/config/cell-7.yaml"; }

std::string virtual_batch_csv(int poses, std::uint64_t seed) {
  const auto cell = shipped_cell();
  const VirtualRobot robot =
      demand(read_virtual_robot(TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml", cell));
  SimulateOptions options;
  options.seed = seed;
  return to_csv(demand(simulate(robot, draw_joints(*cell, poses, seed), options)));
}

std::vector<std::vector<double>> virtual_joints(int poses, std::uint64_t seed) {
  const Eigen::MatrixXd q = draw_joints(*shipped_cell(), poses, seed);
  std::vector<std::vector<double>> rows;
  for (Eigen::Index row = 0; row < q.rows(); ++row) {
    const Eigen::VectorXd values = q.row(row);
    rows.emplace_back(values.begin(), values.end());
  }
  return rows;
}

}  // namespace trammel::test
