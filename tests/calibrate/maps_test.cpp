#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/calibrate_with_maps.h"
#include "server/calibrate/maps/map_evidence.h"
#include "server/error_sources/joint_map.h"
#include "tests/support/calibrated.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/virtual_robot.h"

// Maps whose spectra nobody tells, on arms of the second simulation.
namespace trammel {
namespace {

const CalibrateOptions kWeigh{.held = {}, .weigh_links = true};
const double kMapsNoise_mm = 0.013 * std::sqrt(3.0);

/// rad: what a joint (0-based) is off by at that angle.
using Shape = std::function<double(Eigen::Index joint, double angle)>;

test::HeavyArm arm_with(const Shape& shape) {
  test::HeavyArm arm = test::draw_heavy_arm({.seed = 5});
  hidden::Effect effect;
  effect.cause.cause = "joint_map";
  effect.act = [shape](const hidden::MeasuringPose& pose, const Eigen::VectorXd&,
                       hidden::Moment& moment) {
    for (Eigen::Index j = 0; j < moment.q.size(); ++j) moment.q(j) += shape(j, pose.q(j));
  };
  arm.world.effects = {effect};
  return arm;
}

/// % of the measured coordinates that lie within 1.96 standard deviations.
double inside(const CalibrationResult& found, const MeasurementBatch& batch) {
  double within = 0;
  for (const Measurement& m : batch.measurements) {
    Eigen::MatrixXd J;
    const Vector3 off = m.p_W - found.model.pose_W(m.context, found.model.values, &J).translation();
    const Eigen::MatrixXd along = J.topRows<3>();
    const Vector3 variance = (along * found.covariance).cwiseProduct(along).rowwise().sum();
    for (Eigen::Index k = 0; k < 3; ++k)
      within +=
          std::abs(off(k)) < 1.96 * std::hypot(std::sqrt(variance(k)), 0.013e-3, found.discrepancy)
              ? 1
              : 0;
  }
  return 100 * within / (3 * static_cast<double>(batch.measurements.size()));
}

/// Harmonics of the map of a joint (1-based), as its spelling says.
int harmonics(const CalibrationResult& found, int joint) {
  const std::string map = fmt::format("joint_map:{}@", joint);
  for (const ErrorSourcePtr& source : found.model.sources) {
    if (source->name().starts_with(map)) return std::stoi(source->name().substr(map.size()));
  }
  return -1;
}

TEST(Maps, AJointThatIsOffTwentySixTimesATurnGetsThatManyHarmonicsAndTheOthersFew) {
  const test::HeavyArm arm = arm_with([](Eigen::Index j, double angle) {
    return j == 1 ? 8e-5 * std::sin(3 * angle + 1) + 3e-5 * std::cos(26 * angle) : 0;
  });
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const MeasurementBatch fresh = test::measured(arm, 500, 2);
  const std::vector<std::string> open = {"base", "geometry", "compliance", "joint_map:2",
                                         "joint_map:5"};
  const CalibrationResult found = test::demand(calibrate_with_maps(arm.cell, open, batch, kWeigh));
  EXPECT_GE(harmonics(found, 2), 26);
  EXPECT_LE(harmonics(found, 5), 12);
  EXPECT_LE(test::held_out_mm(found, fresh), 1.2 * kMapsNoise_mm);
  EXPECT_GT(inside(found, fresh), 93);
  EXPECT_LT(inside(found, fresh), 98);
  const std::vector<std::string> told = {"base", "geometry", "compliance", "joint_map:2@48",
                                         "joint_map:5@48"};
  EXPECT_LT(test::held_out_mm(found, fresh),
            test::held_out_mm(test::demand(calibrate(arm.cell, told, batch, kWeigh)), fresh));
}

TEST(Maps, AnArmWithoutMapsIsHardlyWorseForAskingAfterThem) {
  const test::HeavyArm arm = arm_with([](Eigen::Index, double) { return 0; });
  const MeasurementBatch batch = test::measured(arm, 150, 1);
  const MeasurementBatch fresh = test::measured(arm, 500, 2);
  const std::vector<std::string> without = {"base", "geometry", "compliance"};
  std::vector<std::string> open = without;
  for (const char* map : {"joint_map:2", "joint_map:3", "joint_map:4"}) open.emplace_back(map);
  const double plain =
      test::held_out_mm(test::demand(calibrate(arm.cell, without, batch, kWeigh)), fresh);
  EXPECT_LE(
      test::held_out_mm(test::demand(calibrate_with_maps(arm.cell, open, batch, kWeigh)), fresh),
      1.02 * plain);
}

TEST(Maps, ASpectrumThatIsToldStays) {
  const auto cell = test::cell_7();
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 60, 3);
  const std::vector<std::string> specs = {"base", "joint_map:2@7", "joint_map:3@5+120+3+1"};
  const CalibrationResult found = test::demand(calibrate_with_maps(cell, specs, batch, {}));
  const CalibrationResult plain = test::demand(calibrate(cell, specs, batch, {}));
  EXPECT_EQ(found.model.values, plain.model.values);
  EXPECT_FALSE(calibrate_with_maps(cell, {"base", "joint_map:2", "joint_map:2"}, batch, {}));
  EXPECT_FALSE(calibrate_with_maps(cell, {"base", "joint_map:*", "joint_map:2"}, batch, {}));
}

/// 40 poses of an arm whose joint 3 has a map.
LinearArm some_arm(std::vector<MapColumns>* maps) {
  const auto cell = test::cell_7();
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 40, 4);
  CalibrationProblem problem{test::demand(make_physical_model(cell, {"base", "geometry"})), batch};
  for (const char* map : {"joint_map:3@9", "joint_map:6@4"}) {
    const ErrorSourcePtr source = test::demand(make_error_source(map, *cell));
    const Eigen::Index first = add_source(problem.model, source);
    problem.model.values(first) = 2e-5;
    maps->push_back({first, static_cast<int>(source->parameters().size() / 2)});
  }
  return linear_arm(problem, {1e-4, 1e-4, true});
}

TEST(Maps, TheSlopesOfTheEvidenceFitCentralDifferences) {
  std::vector<MapColumns> maps;
  const LinearArm arm = some_arm(&maps);
  const MapEvidence evidence(arm, maps);
  Eigen::VectorXd logs = evidence.start();
  for (Eigen::Index k = 0; k < logs.size(); ++k)
    logs(k) += 0.1 * std::sin(static_cast<double>(k) + 1);
  ObjectiveValue at, ahead, behind;
  ASSERT_TRUE(evidence(logs, &at));
  for (Eigen::Index k = 0; k < logs.size(); ++k) {
    Eigen::VectorXd moved = logs;
    moved(k) += 1e-4;
    ASSERT_TRUE(evidence(moved, &ahead));
    moved(k) -= 2e-4;
    ASSERT_TRUE(evidence(moved, &behind));
    EXPECT_NEAR(at.gradient(k), (ahead.value - behind.value) / 2e-4,
                1e-4 * (1 + std::abs(at.gradient(k))))
        << k;
  }
}

TEST(Maps, TheEvidenceIsThatOfTheWholeCovarianceOfTheMeasurements) {
  std::vector<MapColumns> maps;
  const LinearArm arm = some_arm(&maps);
  const MapEvidence evidence(arm, maps);
  // The equations again, as square roots: J with JᵀJ = information, r with -Jᵀr = downhill.
  const auto minus_log = [&](const Eigen::VectorXd& logs) {
    const Eigen::Index P = arm.scaled.scale.size();
    Eigen::VectorXd variance = Eigen::VectorXd::Ones(P), mean = Eigen::VectorXd::Zero(P);
    for (std::size_t k = 0; k < maps.size(); ++k) {
      const MapSpectrum spectrum = evidence.spectrum(logs, k);
      for (Eigen::Index i = maps[k].first; i < maps[k].first + 2 * maps[k].harmonics; ++i) {
        variance(i) = std::pow(
            spectrum.stddev(static_cast<int>(i - maps[k].first) / 2 + 1) / arm.scaled.scale(i), 2);
        mean(i) = -arm.scaled.prior(i);
      }
    }
    double sum = 0;
    Eigen::MatrixXd J(2 * P, P);
    Eigen::VectorXd r(2 * P);
    for (std::size_t k = 0; k < 2; ++k) {
      const double factor = std::exp(logs(logs.size() - 2 + static_cast<Eigen::Index>(k)));
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(arm.kinds[k].information);
      const Eigen::VectorXd root = eigen.eigenvalues().cwiseMax(1e-12).cwiseSqrt();
      const auto rows = static_cast<Eigen::Index>(k) * P;
      J.middleRows(rows, P) =
          std::sqrt(factor) * (root.asDiagonal() * eigen.eigenvectors().transpose());
      r.segment(rows, P) =
          -std::sqrt(factor) * (root.cwiseInverse().asDiagonal() *
                                eigen.eigenvectors().transpose() * arm.kinds[k].downhill);
      sum += 0.5 * (factor * arm.kinds[k].square - r.segment(rows, P).squaredNorm() -
                    arm.kinds[k].count * std::log(factor));
    }
    const Eigen::MatrixXd covariance =
        Eigen::MatrixXd::Identity(2 * P, 2 * P) + J * variance.asDiagonal() * J.transpose();
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    const Eigen::VectorXd off = factor.matrixL().solve(r + J * mean);
    return sum + 0.5 * off.squaredNorm() + factor.matrixLLT().diagonal().array().log().sum();
  };
  // The wide priors of the logarithms: rms, knee, power; noise.
  const auto prior = [&](const Eigen::VectorXd& logs) {
    const Eigen::VectorXd off = logs - evidence.start();
    double sum = 0;
    for (Eigen::Index k = 0; k < off.size(); ++k) {
      const double spread = k >= off.size() - 2 ? 3.0 : k % 3 == 0 ? 2.0 : k % 3 == 1 ? 1.0 : 0.5;
      sum += 0.5 * std::pow(off(k) / spread, 2);
    }
    return sum;
  };
  const Eigen::VectorXd one = evidence.start();
  const Eigen::VectorXd other = one + 0.3 * Eigen::VectorXd::LinSpaced(one.size(), -1, 1);
  ObjectiveValue at_one, at_other;
  ASSERT_TRUE(evidence(one, &at_one));
  ASSERT_TRUE(evidence(other, &at_other));
  const double expected = minus_log(other) + prior(other) - minus_log(one) - prior(one);
  EXPECT_NEAR(at_other.value - at_one.value, expected, 1e-6 * std::abs(expected) + 1e-4);
}

}  // namespace
}  // namespace trammel
