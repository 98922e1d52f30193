#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/trainer/trainer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

/// A cell that is measured repeatedly: a trainer with its own store, and a robot that it never
/// sees.
namespace trammel::test {

class LearningCell {
 public:
  explicit LearningCell(std::shared_ptr<const Cell> cell, TrainerOptions options = {});

  /// Submits the batch and waits for its job; throws where it does not end.
  JobProgress submit(MeasurementBatch batch);
  /// The version in force; 0 where none is.
  [[nodiscard]] int in_force() const;
  [[nodiscard]] const CompensatedModel& model() const;
  /// A stored version.
  [[nodiscard]] const CompensatedModel& version(int version);
  [[nodiscard]] Trainer& trainer() { return *trainer_; }
  JobProgress finished(std::int64_t job);

 private:
  TemporaryFolder folder_;
  std::string cell_;
  int submitted_ = 0;
  std::unique_ptr<Store> store_;
  ModelRegistry registry_;
  std::unique_ptr<Trainer> trainer_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::int64_t, JobProgress> finished_;  // guarded by mutex_
  ServedModelPtr asked_;                          // the last version that was asked for
};

/// m, rms over the cell's joint ranges of the model's error for the robot without noise, after the
/// best shift and turn of the whole arm.
[[nodiscard]] double true_error(const CompensatedModel& model, const VirtualRobot& robot,
                                const std::string& tool = {});

/// The conditions of measuring on that day.
struct Day {
  int poses = 200;
  std::uint64_t seed = 1;
  double noise = 1;  ///< factor on that of the cell's tracker
  double corner =
      1;  ///< share of each joint's range that is measured, about a place drawn with the seed
  bool set_up_anew =
      false;  ///< the tracker stands up to 500 mm and 20 deg about the vertical elsewhere
  std::string tool = {};
};
[[nodiscard]] MeasurementBatch measured_on(const VirtualRobot& robot, const Day& day);

}  // namespace trammel::test
