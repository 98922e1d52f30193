#include "server/diagnose/evidence/beginning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/scan.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Steps of a kind that begin anywhere in the noise of 80 poses of the chapter 5 robot.
class Beginning : public testing::Test {
 protected:
  Beginning()
      : batch_(test::demand(
                   check_against_cell(test::measured(test::chapter_5_robot(cell_), 80, 3), *cell_))
                   .rows()),
        calibration_(test::demand(calibrate(cell_, cell_->model.error_sources, batch_, {}))) {
    std::vector<Parameter> priors;
    for (const IdentifiedParameter& one : calibration_.parameters) priors.push_back(one.parameter);
    problem_.emplace(calibration_.model, batch_, priors,
                     candidate_sources(*cell_, batch_, nullptr));
    families_ = make_families(*problem_);
  }
  const Family& family(const std::string& kind) const {
    return **std::find_if(families_.begin(), families_.end(), [&](const FamilyPtr& one) {
      const Cause cause = one->cause(one->typical());
      return cause.cause == kind && !cause.pose_id.empty();
    });
  }

  /// Of steps of that squared length outside the model's own parameters: how many sets hold the
  /// pose at which it began, and how many poses they hold in all.
  struct Held {
    int steps = 0, held = 0, poses = 0;
  };
  Held held(const std::string& kind, double lambda, int steps) const {
    const Family& one = family(kind);
    const Background rest(problem_->nuisance());
    const Eigen::MatrixXd noise = draw_null(rest, steps, 7);
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    Best always = one.typical();
    always.pose = 0;
    Held held;
    for (int k = 0; k < steps; ++k) {
      Best truth = one.typical();
      truth.pose = static_cast<Index>(8 + random() % 64);
      const Eigen::MatrixXd columns = one.columns(truth);
      const VectorXd direction =
          VectorXd::NullaryExpr(columns.cols(), [&] { return normal(random); });
      VectorXd step = columns * direction;
      step *= std::sqrt(lambda / step.dot(rest.project(step).col(0)));
      const VectorXd data = noise.col(k) + step;
      const Index found = one.scan({rest}, rest.project(data)).front().pose;
      const std::vector<Index> possible =
          possible_beginnings(*problem_, one.columns(always), rest, data, found);
      EXPECT_TRUE(std::is_sorted(possible.begin(), possible.end()));
      EXPECT_EQ(std::count(possible.begin(), possible.end(), found), 1);
      ++held.steps;
      held.poses += static_cast<int>(possible.size());
      held.held += static_cast<int>(std::count(possible.begin(), possible.end(), truth.pose));
    }
    return held;
  }

  std::shared_ptr<const Cell> cell_ = test::cell_7();
  MeasurementBatch batch_;
  CalibrationResult calibration_;
  std::optional<LinearProblem> problem_;
  std::vector<FamilyPtr> families_;
};

TEST_F(Beginning, IsAmongThosePossibleAsOftenAsTheySay) {
  for (const char* kind : {"tracker_moved", "joint_slip", "tool_changed"}) {
    const Held small = held(kind, 80, 200);
    EXPECT_GE(small.held, 0.93 * small.steps) << kind;  // 1.3 standard deviations of 200 below 95 %
    EXPECT_LT(small.poses, 20 * small.steps) << kind << ": a set of everything says nothing";
  }
}

TEST_F(Beginning, OfALargeStepIsOnePoseOrTwo) {
  for (const char* kind : {"tracker_moved", "tool_changed"}) {
    const Held large = held(kind, 20000, 100);
    EXPECT_GE(large.held, 0.95 * large.steps) << kind;
    EXPECT_LE(large.poses, 2 * large.steps) << kind;
  }
}

TEST(BeginningFound, IsToldWithTheFinding) {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  const hidden::HiddenCase hidden =
      hidden::hide({.kind = "joint_slip", .seed = 1, .lambda = 80, .poses = 100});
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, options));
  ASSERT_EQ(diagnosis.findings.size(), 1U) << test::told(diagnosis);
  const Finding& finding = diagnosis.findings[0];
  for (const std::string& id :
       {finding.cause.pose_id, fmt::format("p{}", hidden.truth.causes[0].first + 1)}) {
    EXPECT_TRUE(std::any_of(finding.may_begin_at.begin(), finding.may_begin_at.end(),
                            [&](const PossibleBeginning& place) { return place.pose_id == id; }))
        << id << "\n"
        << test::told(diagnosis);
  }
}

}  // namespace
}  // namespace trammel::cause_search
