#include "server/diagnose/search/pruning.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

// A name that gains nothing is none.

namespace trammel::cause_search {
namespace {

constexpr double kAnyEvidence = -1e9;  // nat: a line that all pass

std::vector<Parameter> priors_of(const CalibrationResult& calibration) {
  std::vector<Parameter> priors;
  for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  return priors;
}

/// A search that has accepted `source`. `ripple`: of the robot's joint 3, rad.
SearchResult accepting(const std::string& source, double ripple) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  const Eigen::Index at =
      add_source(robot.truth, test::demand(make_error_source("gear_transmission:3@40", *cell)));
  robot.truth.values(at + 1) = ripple;
  SearchResult found;
  found.all = found.batch = test::measured(robot, 120, 5);
  const CalibrationResult calibration =
      test::demand(calibrate(cell, cell->model.error_sources, found.batch, {}));
  found.before = {calibration.model, priors_of(calibration)};
  found.after = found.before;
  EXPECT_TRUE(add_to(found.after, source));
  refine(found.after, found.batch, {});
  Accepted one;
  one.cause = cause_at(cause_spelled(source), 2);
  one.source = one.in_model = source;
  found.accepted.push_back(one);
  return found;
}

TEST(Pruning, ACauseThatPredictsPosesHeldOutIsKept) {
  EXPECT_FALSE(weak_cause(accepting("gear_transmission:3@40", 6e-5), kAnyEvidence));
}

TEST(Pruning, OneThatGainsNothingIsDroppedHoweverSureItIs) {
  EXPECT_EQ(weak_cause(accepting("axis_runout:3", 0), kAnyEvidence), 0u);
  EXPECT_EQ(weak_cause(accepting("gear_transmission:3@40", 0), kAnyEvidence), 0u);
  SearchResult tiny = accepting("gear_transmission:3@40", 2e-6);
  tiny.accepted.front().best.evidence = 1e6;
  EXPECT_EQ(weak_cause(tiny, kAnyEvidence), 0u) << "a hundredth of what is left";
}

}  // namespace
}  // namespace trammel::cause_search
