#include "server/exchange/si.h"

#include <gtest/gtest.h>

#include <set>

#include "server/base/units.h"

namespace trammel::exchange {
namespace {

TEST(Exchange, PosesHaveMillimetresAndAQuaternionAndComeBack) {
  const trammel::Pose X = pose_zyx({.1, -.2, 1.3}, .4, -.5, .6);
  const Pose pose = from_si(X);
  EXPECT_DOUBLE_EQ(pose.xyz_mm[1], -200);
  EXPECT_TRUE(to_si(pose).isApprox(X, 1e-14));
  const Pose longer{
      pose.xyz_mm,
      {2 * pose.q_wxyz[0], 2 * pose.q_wxyz[1], 2 * pose.q_wxyz[2], 2 * pose.q_wxyz[3]}};
  EXPECT_TRUE(to_si(longer).isApprox(X, 1e-14)) << "its length does not count";
}

TEST(Exchange, JointsAreDegreesAndThoseOfRailsMillimetres) {
  Joint rail;
  rail.type = JointType::kPrismatic;
  const Chain robot = Chain::make("rail and hinge", {rail, Joint{}}).value();
  const Rails rails = rails_of(robot);
  EXPECT_EQ(rails, rails_of({JointType::kPrismatic, JointType::kRevolute}));
  const JointVector q = Eigen::Vector2d(1.5, kPi / 2);
  EXPECT_EQ(degrees_from_si(q, rails), (std::vector<double>{1500, 90}));
  EXPECT_EQ(asked_from_si(q, rails), (std::vector<double>{1500, kPi / 2}));
  EXPECT_TRUE(si_from_degrees(degrees_from_si(q, rails), robot).isApprox(q, 1e-15));
  EXPECT_TRUE(si_from_asked(asked_from_si(q, rails), robot) == q);
  EXPECT_EQ(degrees_from_si(q, {})[0], to_deg(1.5)) << "a joint beyond the list is no rail";
}

TEST(Exchange, EveryFigureHasANameAndColumnsOfItsOwn) {
  std::set<std::string> names, columns;
  std::size_t figures = 0;
  const auto take = [&](const auto& figure) {
    ++figures;
    names.insert(figure.name);
    const bool is_told = figure.place != Place::kNowhere && figure.place != Place::kJsonOnly;
    EXPECT_EQ(is_told, *figure.columns != '\0') << figure.name;
    if (is_told) {
      EXPECT_TRUE(columns.insert(figure.columns).second) << figure.name;
    }
  };
  each_figure(kPredictionFigures, take);
  each_figure(kCorrectionFigures, take);
  EXPECT_EQ(names.size(), figures);
}

}  // namespace
}  // namespace trammel::exchange
