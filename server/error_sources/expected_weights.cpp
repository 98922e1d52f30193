#include "server/error_sources/expected_weights.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr double kMassOfReach =
    60;  // kg/m^3: a robot's moving mass over the cube of its reach, as makers list them
constexpr double kSpreadUnknown = 1;  // share of the expected moment, where no masses are stated
constexpr double kSpreadTold = 0.3;   // likewise, where masses are stated
constexpr double kLeastLever = 0.05;  // m: a link's weight may be that far beside its axis

double length_of(const Joint& joint) { return std::hypot(joint.link.d, joint.link.a); }

double reach_of(const Chain& chain) {
  double reach = kLeastLever;
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joint(i).type == JointType::kRevolute) reach += length_of(chain.joint(i));
  return reach;
}

double told_mass(const Chain& chain) {
  double sum = 0;
  for (int i = 0; i < chain.size(); ++i) sum += chain.joint(i).mass;
  return sum;
}

}  // namespace

ExpectedWeights expected_weights(const Chain& chain) {
  const int n = chain.size();
  const bool told = chain.has_link_masses();
  const double reach = reach_of(chain);
  const double per_metre = (told ? told_mass(chain) : kMassOfReach * std::pow(reach, 3)) / reach;
  ExpectedWeights expected{FirstMoments::Zero(2, n), JointArray::Zero(n)};
  double beyond = per_metre * kLeastLever;
  double along = 0;  // of the next link's moment, along that link's axis, kg m
  for (int i = n - 1; i >= 0; --i) {
    const LinkGeometry& link = chain.joint(i).link;
    const double own = per_metre * length_of(chain.joint(i));
    const double at_end = own / 2 + beyond;  // half of its own mass, and all that it carries
    const Eigen::Vector2d moment(at_end * link.a, -std::sin(link.alpha) * along);
    expected.spread(i) =
        (told ? kSpreadTold : kSpreadUnknown) * (moment.norm() + kLeastLever * (own + beyond));
    if (!told) expected.moment.col(i) = moment;
    along = at_end * link.d + std::cos(link.alpha) * along;
    beyond += own;
  }
  return expected;
}

}  // namespace trammel
