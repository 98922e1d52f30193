#include "tests/support/learning_cell.h"

#include <chrono>
#include <random>
#include <stdexcept>

#include "server/measurement/checked_batch.h"
#include "server/plan/plan.h"
#include "server/robot/rigid_fit.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

constexpr std::chrono::seconds kLearningCellLimit{900};  // a training waits where others compute
constexpr int kTruePoses = 400;

}  // namespace

LearningCell::LearningCell(std::shared_ptr<const Cell> cell, TrainerOptions options)
    : cell_(cell->name), store_(demand(Store::open(folder_.file("trammel.db")))) {
  trainer_ = std::make_unique<Trainer>(std::map{std::pair{cell_, std::move(cell)}}, *store_,
                                       registry_, options);
  trainer_->set_listeners(
      [this](const JobProgress& progress) {
        if (progress.stage != JobStage::kDone && progress.stage != JobStage::kFailed) return;
        const std::lock_guard lock(mutex_);
        finished_[progress.job] = progress;
        changed_.notify_all();
      },
      nullptr);
  static_cast<void>(demand(trainer_->start()));
}

JobProgress LearningCell::finished(std::int64_t job) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, kLearningCellLimit, [&] { return finished_.contains(job); })) {
    throw std::runtime_error(fmt::format("job {} does not end", job));
  }
  return finished_.at(job);
}

JobProgress LearningCell::submit(MeasurementBatch batch) {
  ++submitted_;
  const std::string id = fmt::format("day-{}", submitted_);
  return finished(demand(trainer_->submit(cell_, id, to_csv(batch), "client:" + id)));
}

int LearningCell::in_force() const {
  const auto served = registry_.in_force(cell_);
  return served ? served->version : 0;
}

const CompensatedModel& LearningCell::model() const { return registry_.in_force(cell_)->model; }

const CompensatedModel& LearningCell::version(int version) {
  asked_ = demand(registry_.version(cell_, version));
  return asked_->model;
}

double true_error(const CompensatedModel& model, const VirtualRobot& robot,
                  const std::string& tool) {
  const Cell& cell = *robot.truth.cell;
  const Eigen::MatrixXd q = demand(plan_poses(cell, {kTruePoses, 987654}));
  SimulateOptions exact;
  exact.noise = false;
  exact.tool = tool;
  const MeasurementBatch truth =
      demand(check_against_cell(demand(simulate(robot, q, exact)), cell)).rows();
  Eigen::Matrix3Xd real(3, q.rows()), predicted(3, q.rows());
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    const Measurement& m = truth.measurements[static_cast<std::size_t>(i)];
    real.col(i) = m.p_W;
    predicted.col(i) =
        model.predict(m.context.q, m.context.tool, m.context.payload).X_BT_predicted.translation();
  }
  const Pose X_WB = demand(fit_transform(real, predicted));
  return std::sqrt((real - (X_WB * predicted)).squaredNorm() / static_cast<double>(q.rows()));
}

MeasurementBatch measured_on(const VirtualRobot& robot, const Day& day) {
  const Cell& cell = *robot.truth.cell;
  std::mt19937_64 random(day.seed * 7919 + 13);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(random);
  };
  JointRanges ranges = demand(planning_ranges(cell));
  for (auto& [low, high] : ranges) {
    const double width = day.corner * (high - low);
    low = uniform(low, high - width);
    high = low + width;
  }
  const Eigen::MatrixXd q = latin_hypercube(ranges, day.poses, day.seed);
  VirtualRobot seen = robot;
  seen.sigma *= day.noise;
  seen.sigma_rotation *= day.noise;
  SimulateOptions options;
  options.seed = day.seed + 1000;
  options.tool = day.tool;
  MeasurementBatch batch = demand(simulate(seen, q, options));
  if (!day.set_up_anew) return batch;
  Pose X = Pose::Identity();
  X.linear() = rotation_exp(Vector3(0, 0, uniform(-20, 20) * 3.141592653589793 / 180));
  X.translation() = Vector3(uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.5, 0.5));
  for (Measurement& m : batch.measurements) {
    m.p_W = X * m.p_W;
    if (m.R_WT) m.R_WT = X.linear() * *m.R_WT;
  }
  return batch;
}

}  // namespace trammel::test
