#include "server/calibrate/instruments/deflection.h"

#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

const std::vector<double> kLoads = {266.243,  532.879,  798.338,
                                    1064.974, 1330.432, 1596.283};  // Table 4.7, N

/// One element of a virtual arm.
struct Truth {
  DeflectionElement element;
  double compliance = 0;   // rad/Nm
  double flexibility = 0;  // 1/(N m^2)
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  Eigen::Vector2d load_bias = Eigen::Vector2d::Zero();
  std::vector<double> reflectors;  // m
};

/// Element 3 of the source: forearm level, EI = 3.4e12 Nmm^2, C = 2.97e-10 rad/Nmm.
Truth forearm() {
  return {{3, 0, 1.342, 0.2}, 2.97e-7, 1 / 3.4e6,
          {30e-6, -71e-6},    {0, 0},  {0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.34}};
}
/// Element 2: lower arm 40 deg above level, rigid, its foot moving with the load.
Truth lower_arm() {
  return {{2, from_deg(40), 1.28, 1.542}, 2.785e-7, 0, {10e-6, -180e-6}, {3.748e-8, -1.959e-8},
          {0.1, 0.4, 0.7, 1.0, 1.28}};
}

/// The element's own deflection at x, from the beam's differential equation: E I y'' = w (l - x)
/// + M, integrated.
Eigen::Vector2d own_deflection(const Truth& truth, double load, double x) {
  const double w = load * std::cos(truth.element.theta);
  const double M = load * truth.element.lever;
  constexpr int kSteps = 2000;
  double slope = (M + w * truth.element.length) * truth.compliance;
  double y = 0;
  const double step = x / kSteps;
  for (int k = 0; k < kSteps; ++k) {
    const auto bend = [&](double at) {
      return truth.flexibility * (w * (truth.element.length - at) + M);
    };
    const double at = k * step;
    y += step * slope + step * step * bend(at + step / 3) / 2;
    slope += step * bend(at + step / 2);
  }
  return y * Eigen::Vector2d(std::sin(truth.element.theta), -std::cos(truth.element.theta));
}

DeflectionData measured(const Truth& truth, double sigma, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  DeflectionData data{"d.csv", {truth.element}, {}};
  const double lever = truth.element.lever + truth.element.length * std::cos(truth.element.theta);
  for (const double load : kLoads) {
    for (const double x : truth.reflectors) {
      for (int repeat = 0; repeat < 2; ++repeat) {
        DeflectionReading reading;
        reading.element = truth.element.element;
        reading.load = load;
        reading.x = x;
        reading.moved =
            own_deflection(truth, load, x) + truth.offset + truth.load_bias * load * lever;
        reading.moved += sigma * Eigen::Vector2d(noise(random), noise(random));
        data.readings.push_back(reading);
      }
    }
  }
  return data;
}

DeflectionResult fitted(const DeflectionData& data, const DeflectionOptions& options = {}) {
  const Result<DeflectionResult> result = fit_deflection(data, options);
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return *result;
}

TEST(Deflection, RecoversJointAndLinkExactlyFromExactReadings) {
  const Truth truth = forearm();
  const ElementResult element = fitted(measured(truth, 0, 1)).elements.front();
  ASSERT_TRUE(element.beam);
  EXPECT_NEAR(element.beam->compliance, truth.compliance, 1e-5 * truth.compliance);
  EXPECT_NEAR(*element.beam->flexibility, truth.flexibility, 1e-5 * truth.flexibility);
  EXPECT_LT((element.beam->offset - truth.offset).norm(), 1e-8);
}

TEST(Deflection, StatesUncertaintiesThatHoldAtThirteenMicrometres) {
  const Truth truth = forearm();
  int compliance = 0;
  int flexibility = 0;
  int offset = 0;
  constexpr int kRuns = 200;
  for (int seed = 1; seed <= kRuns; ++seed) {
    const DeflectionFit fit =
        *fitted(measured(truth, 13e-6, static_cast<std::uint64_t>(seed))).elements.front().beam;
    compliance += std::abs(fit.compliance - truth.compliance) <= fit.compliance_u ? 1 : 0;
    flexibility += std::abs(*fit.flexibility - truth.flexibility) <= fit.flexibility_u ? 1 : 0;
    offset += std::abs(fit.offset.y() - truth.offset.y()) <= fit.offset_u.y() ? 1 : 0;
  }
  for (const int within : {compliance, flexibility, offset}) {
    EXPECT_GE(within, 0.91 * kRuns);
    EXPECT_LE(within, 0.995 * kRuns);
  }
}

TEST(Deflection, ClaimsABeamWhereThereIsOneAndNoneWhereTheLinkIsRigid) {
  Truth bent = forearm();
  Truth rigid = forearm();
  rigid.flexibility = 0;
  int claimed = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    EXPECT_EQ(fitted(measured(bent, 13e-6, seed)).elements.front().verdict, LinkVerdict::kBends)
        << seed;
    claimed += fitted(measured(rigid, 13e-6, seed)).elements.front().verdict == LinkVerdict::kBends
                   ? 1
                   : 0;
  }
  EXPECT_LE(claimed, 2);  // p < 0.01 and a positive sign: one in two hundred
}

TEST(Deflection, CallsALinkRigidOnlyWhenItWouldHaveSeenItBend) {
  Truth rigid = forearm();
  rigid.flexibility = 0;
  EXPECT_EQ(fitted(measured(rigid, 1e-9, 2), {.sigma = 13e-6}).elements.front().verdict,
            LinkVerdict::kCannotTell);
  Truth many = rigid;
  for (int k = 0; k < 400; ++k) many.reflectors.push_back(0.1 + 1.2 * k / 400);
  EXPECT_EQ(fitted(measured(many, 13e-6, 2)).elements.front().verdict, LinkVerdict::kRigid);
}

TEST(Deflection, OneReflectorCannotTellALinkFromAJoint) {
  Truth wrist = forearm();
  wrist.reflectors = {0.2};
  const ElementResult element = fitted(measured(wrist, 13e-6, 1)).elements.front();
  EXPECT_FALSE(element.beam);
  EXPECT_EQ(element.verdict, LinkVerdict::kCannotTell);
  EXPECT_NE(element.sentence.find("one distance"), std::string::npos);
}

TEST(Deflection, ARigidModelOfABentLinkTakesItForASofterJointAndPredictsWorse) {
  const Truth truth = forearm();
  const ElementResult element = fitted(measured(truth, 13e-6, 1)).elements.front();
  EXPECT_GT(element.rigid.compliance, truth.compliance + 4 * element.rigid.compliance_u);
  EXPECT_LT(element.beam->rms_validation, 1.2 * 13e-6 * std::sqrt(2.0));
  EXPECT_GT(element.rigid.rms_validation, 1.3 * element.beam->rms_validation);
}

TEST(Deflection, HoldsOutTheLoadsOfTable47) {
  const DeflectionData data = measured(forearm(), 13e-6, 1);
  EXPECT_EQ(fitted(data).validation_loads, (std::vector<double>{532.879, 1330.432}));
  EXPECT_EQ(fitted(data, {.validation_loads = {1596.283}}).validation_loads,
            (std::vector<double>{1596.283}));
  DeflectionData marked = data;
  for (DeflectionReading& reading : marked.readings) reading.validation = reading.load == kLoads[2];
  EXPECT_EQ(fitted(marked).validation_loads, (std::vector<double>{kLoads[2]}));
}

TEST(Deflection, AFootThatMovesWithTheLoadIsNoticedAndFitted) {
  const Truth truth = lower_arm();
  const DeflectionData data = measured(truth, 13e-6, 1);
  EXPECT_LT(fitted(data).elements.front().load_bias_p_value, 1e-6);
  const ElementResult element = fitted(data, {.load_bias = {2}}).elements.front();
  ASSERT_TRUE(element.rigid.load_bias);
  EXPECT_LT((*element.rigid.load_bias - truth.load_bias).norm(),
            2 * element.rigid.load_bias_u.norm());
  EXPECT_NEAR(element.rigid.compliance, truth.compliance, 2 * element.rigid.compliance_u);
  Truth still = truth;
  still.load_bias.setZero();
  EXPECT_GT(fitted(measured(still, 13e-6, 1)).elements.front().load_bias_p_value, 0.01);
}

TEST(Deflection, ChainedElementsAreSolvedTogether) {
  // The forearm's readings against the ground: what the lower arm does at its end, and its turn
  // there, are in them.
  const Truth lower = lower_arm();
  const Truth upper = forearm();
  DeflectionData data = measured(lower, 13e-6, 1);
  const DeflectionData outer = measured(upper, 13e-6, 2);
  data.elements.push_back(upper.element);
  for (DeflectionReading reading : outer.readings) {
    const double reaction =
        reading.load * (lower.element.lever + lower.element.length * std::cos(lower.element.theta));
    const double turn = reaction * lower.compliance;  // clockwise
    reading.moved +=
        own_deflection(lower, reading.load, lower.element.length) + reaction * lower.load_bias;
    reading.moved += Eigen::Vector2d(0, -turn * reading.x);  // the forearm is level
    data.readings.push_back(reading);
  }
  const DeflectionResult result = fitted(data, {.chained = true, .load_bias = {2}});
  ASSERT_EQ(result.elements.size(), 2u);
  EXPECT_NEAR(result.elements[0].beam->compliance, lower.compliance,
              1.5 * result.elements[0].beam->compliance_u);
  EXPECT_NEAR(result.elements[1].beam->compliance, upper.compliance,
              1.5 * result.elements[1].beam->compliance_u);
  EXPECT_NEAR(*result.elements[1].beam->flexibility, upper.flexibility,
              1.5 * result.elements[1].beam->flexibility_u);
  EXPECT_NEAR(result.variance_factor, 1, 0.3);
  EXPECT_GT(fitted(data, {.load_bias = {2}}).variance_factor,
            10);  // not chained: the lower arm's turn is no forearm
}

TEST(Deflection, Refuses) {
  const DeflectionData data = measured(forearm(), 13e-6, 1);
  DeflectionData one_load = data;
  std::erase_if(one_load.readings,
                [](const DeflectionReading& reading) { return reading.load != kLoads[0]; });
  EXPECT_EQ(refusal_of(fit_deflection(one_load, {})), Refusal(data.where, {}, "load").beyond(1, 2));
  EXPECT_EQ(refusal_of(fit_deflection(data, {.validation_loads = {500}})),
            Refusal(data.where, {}, "load").value(500));
  EXPECT_EQ(refusal_of(fit_deflection(data, {.load_bias = {5}})),
            Refusal(data.where, {}, "element").value(5));
  Truth one_place = forearm();
  one_place.reflectors = {0.5};
  EXPECT_EQ(refusal_of(fit_deflection(measured(one_place, 13e-6, 1), {.load_bias = {3}})),
            Refusal("d.csv").beyond(4, 5));
}

TEST(DeflectionCsv, ReadsReadingsAndRefusesWithRow) {
  const std::string header =
      "element,load_n,x_mm,dx_mm,dz_mm,theta_deg,length_mm,lever_mm,sigma_mm,set\n";
  const Result<DeflectionData> data =
      parse_deflection_csv(header + "3,266.2,200,0.01,-0.2,10,1342,200,0.013,train\n", "d.csv");
  ASSERT_TRUE(data) << data.error().message;
  EXPECT_NEAR(data->elements.front().theta, from_deg(10), 1e-12);
  EXPECT_NEAR(data->readings.front().moved.y(), -0.2e-3, 1e-12);
  EXPECT_EQ(data->readings.front().validation, false);
  const auto refusal = [&](const std::string& rows) {
    return refusal_of(parse_deflection_csv(header + rows, "d.csv"));
  };
  EXPECT_EQ(refusal("3,266,200,0,0,10,1342,200,0,train\n"),
            Refusal("d.csv", 2, "sigma_mm").beyond(0, 0));
  EXPECT_EQ(refusal("3,266,200,0,0,10,0,200,,\n"), Refusal("d.csv", 2, "length_mm").beyond(0, 0));
  EXPECT_EQ(refusal("3,1,200,0,0,10,1342,200,,\n3,1,200,0,0,11,1342,200,,\n"),
            Refusal("d.csv", 3, "element").value(3));
  EXPECT_EQ(refusal("3,1,200,0,0,10,1342,200,,test\n"), Refusal("d.csv", 2, "set").text("test"));
}

}  // namespace
}  // namespace trammel
