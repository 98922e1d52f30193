#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/units.h"
#include "server/diagnose/families/family.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAmplitude = 1e-3;                            // rad, prior: wide, the data choose
constexpr double kPriorShare = 1 / (kAmplitude * kAmplitude);  // of the information, per rad^2
constexpr double kLowestOrder = 2;  // eccentricity and geometry lie below
constexpr double kHighestOrder =
    400;  // cycles a joint turn: two waves a motor turn at a ratio of 200
constexpr double kStep =
    0.2;  // of the smallest difference between orders that the joint's range resolves
constexpr double kFineSteps = 5;   // in a coarse step, near the best order
constexpr Index kFineOrders = 11;  // a coarse step to either side
constexpr double kOrdersOfMaps =
    60;  // cycles a joint turn: a map of 48 harmonics contains the lower ones
constexpr double kMostAbsorbed = 0.75;
constexpr double kSameStep = 1e-6;  // of a step: rounding
constexpr double kTypicalOrder =
    50;  // cycles a joint turn: to speak of a gear where none was found
constexpr Index kOrdersAtATime = 96;

class OrderFamily final : public Family {
 public:
  OrderFamily(const LinearProblem& problem, Cause cause)
      : problem_(problem), cause_(std::move(cause)), joint_(cause_.joint) {
    q_.resize(problem.poses());
    for (Index i = 0; i < q_.size(); ++i) q_(i) = problem.gear_angles(i)(joint_);
    const double span = q_.maxCoeff() - q_.minCoeff();
    step_ = kStep * 2 * kPi / std::max(span, thresholds::kSmallestSpan);
    turn_ = {(step_ * q_).array().sin(), (step_ * q_).array().cos()};
    orders_ = 1 + static_cast<Index>((kHighestOrder - kLowestOrder) / step_);
  }

  bool moves() const { return q_.maxCoeff() - q_.minCoeff() > thresholds::kSmallestSpan; }
  Cause cause(const Best& best) const override {
    Cause cause = cause_;
    if (best.order > 0) cause.order = best.order;
    return cause;
  }
  std::string source(const Best& best) const override {
    return fmt::format("{}@{:.4f}", to_string(cause_), best.order);
  }
  Best typical() const override { return {.freedom = 2, .order = kTypicalOrder}; }

  MatrixXd columns(const Best& best) const override {
    MatrixXd C(problem_.rows(), 2);
    for (Index i = 0; i < problem_.poses(); ++i) {
      const Index row = problem_.first_row(i);
      const Index count = problem_.row_count(i);
      const auto turn = problem_.by_joint().col(joint_).segment(row, count);
      C.col(0).segment(row, count) = kAmplitude * std::sin(best.order * q_(i)) * turn;
      C.col(1).segment(row, count) = kAmplitude * std::cos(best.order * q_(i)) * turn;
    }
    return C;
  }

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const override {
    const Shares& shares = shares_in(view, projected);
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    const bool one = projected.cols() == 1;
    scan_orders(view, shares, one ? promising_orders(shares) : all_places(), best);
    // Refines once more around the best order for the data themselves. The data are the first
    // column.
    if (one) {
      const double fine = step_ / kFineSteps;
      const double from = std::max(kLowestOrder, best[0].order - step_);
      const VectorXd orders =
          VectorXd::LinSpaced(kFineOrders, from, from + fine * (kFineOrders - 1));
      const Waves waves = waves_of(orders);
      improve(shares, orders, waves, left_beside(view, shares.square, waves), best);
    }
    for (Best& of_data : best) of_data.evidence = log_evidence(of_data.strength, of_data.freedom);
    return best;
  }

  Periodogram periodogram_of(const Background& background) const {
    const MatrixXd projected = background.project(problem_.residual());
    const View view{background};
    const Shares& shares = shares_in(view, projected);
    Periodogram periodogram{joint_, all_orders(), VectorXd(orders_), 0};
    for (Index first = 0; first < orders_; first += kOrdersAtATime) {
      const Index count = std::min(kOrdersAtATime, orders_ - first);
      const Waves waves = waves_of(periodogram.order.segment(first, count));
      const std::vector<Information> left = left_beside(view, shares.square, waves);
      const VectorXd a = waves.sine.transpose() * shares.along.col(0);
      const VectorXd b = waves.cosine.transpose() * shares.along.col(0);
      for (Index k = 0; k < count; ++k) {
        const Information& own = left[static_cast<std::size_t>(k)];
        periodogram.strength(first + k) = own.tells() ? own.strength(a(k), b(k)) : 0;
      }
    }
    return periodogram;
  }

 private:
  const Shares& shares_in(const View& view, const MatrixXd& projected) const {
    return shares_of(problem_, view, name_, problem_.by_joint().col(joint_), projected);
  }
  std::vector<Index> all_places() const {
    std::vector<Index> places(static_cast<std::size_t>(orders_));
    std::iota(places.begin(), places.end(), Index{0});
    return places;
  }
  VectorXd all_orders() const {
    return kLowestOrder +
           step_ * VectorXd::LinSpaced(orders_, 0, static_cast<double>(orders_ - 1)).array();
  }

  /// A sine and a cosine of every pose's angle, N x orders each.
  struct Waves {
    MatrixXd sine, cosine;
  };
  /// The waves of `orders`. If orders are one step apart, each wave comes from the previous one by
  /// a rotation.
  Waves waves_of(const VectorXd& orders) const {
    Waves waves{MatrixXd(q_.size(), orders.size()), MatrixXd(q_.size(), orders.size())};
    for (Index k = 0; k < orders.size(); ++k) {
      if (k > 0 && std::abs(orders(k) - orders(k - 1) - step_) < kSameStep * step_) {
        const auto s = waves.sine.col(k - 1).array();
        const auto c = waves.cosine.col(k - 1).array();
        waves.sine.col(k) = s * turn_.cosine.array() + c * turn_.sine.array();
        waves.cosine.col(k) = c * turn_.cosine.array() - s * turn_.sine.array();
      } else {
        waves.sine.col(k) = (orders(k) * q_).array().sin();
        waves.cosine.col(k) = (orders(k) * q_).array().cos();
      }
    }
    return waves;
  }

  /// The information of a wave about itself, 2 x 2: the prior's share and its own square.
  struct Information {
    double ss = kPriorShare, cc = kPriorShare, sc = 0;
    [[nodiscard]] double determinant() const { return ss * cc - sc * sc; }
    [[nodiscard]] bool tells() const { return determinant() > 0; }
    [[nodiscard]] double strength(double a, double b) const {
      return (cc * a * a - 2 * sc * a * b + ss * b * b) / determinant();
    }
  };
  static Information own_information(const Waves& waves, Index k, const VectorXd& square) {
    const auto sine = waves.sine.col(k);
    const auto cosine = waves.cosine.col(k);
    return {kPriorShare + sine.cwiseAbs2().dot(square),
            kPriorShare + cosine.cwiseAbs2().dot(square), sine.cwiseProduct(cosine).dot(square)};
  }

  /// The places of the orders among which the strongest one must be. The gain of an order without
  /// the background is cheap to compute, and the real gain is at most that. Beyond the orders in
  /// the joint's maps, the background absorbs at most kMostAbsorbed of a wave. An order that is
  /// weaker even so is not the strongest.
  std::vector<Index> promising_orders(const Shares& shares) const {
    const VectorXd orders = all_orders();
    VectorXd least(orders_);
    for (Index first = 0; first < orders_; first += kOrdersAtATime) {
      const Index count = std::min(kOrdersAtATime, orders_ - first);
      const Waves waves = waves_of(orders.segment(first, count));
      const VectorXd a = waves.sine.transpose() * shares.along.col(0);
      const VectorXd b = waves.cosine.transpose() * shares.along.col(0);
      for (Index k = 0; k < count; ++k)
        least(first + k) = own_information(waves, k, shares.square).strength(a(k), b(k));
    }
    const double strongest = least.maxCoeff();
    std::vector<Index> promising;
    for (Index k = 0; k < orders_; ++k) {
      if (orders(k) < kOrdersOfMaps || least(k) >= (1 - kMostAbsorbed) * strongest)
        promising.push_back(k);
    }
    return promising;
  }

  /// The information of each wave that the background leaves.
  std::vector<Information> left_beside(const View& view, const VectorXd& square,
                                       const Waves& waves) const {
    std::vector<Information> all;
    if (waves.sine.cols() == 0) return all;
    const MatrixXd& root = root_shares_of(problem_, view, name_, problem_.by_joint().col(joint_));
    const MatrixXd sine = transposed_product(root, waves.sine);
    const MatrixXd cosine = transposed_product(root, waves.cosine);
    for (Index k = 0; k < sine.cols(); ++k) {
      Information left = own_information(waves, k, square);
      left.ss -= sine.col(k).squaredNorm();
      left.cc -= cosine.col(k).squaredNorm();
      left.sc -= sine.col(k).dot(cosine.col(k));
      all.push_back(left);
    }
    return all;
  }

  /// Improves `best` where an order at one of `places` is stronger.
  void scan_orders(const View& view, const Shares& shares, const std::vector<Index>& places,
                   std::vector<Best>& best) const {
    std::vector<std::optional<Information>>& known = left_.of(view, [&] {
      return std::vector<std::optional<Information>>(static_cast<std::size_t>(orders_));
    });
    const VectorXd orders = all_orders();
    constexpr auto kSome = static_cast<std::size_t>(kOrdersAtATime);
    for (std::size_t first = 0; first < places.size(); first += kSome) {
      const std::vector<Index> some(
          places.begin() + static_cast<std::ptrdiff_t>(first),
          places.begin() + static_cast<std::ptrdiff_t>(std::min(first + kSome, places.size())));
      const Waves waves = waves_of(orders(some));
      improve(shares, orders(some), waves, recalled(view, shares.square, waves, some, known), best);
    }
  }
  /// left_beside(), of which `known` has some places already and gets the others.
  std::vector<Information> recalled(const View& view, const VectorXd& square, const Waves& waves,
                                    const std::vector<Index>& places,
                                    std::vector<std::optional<Information>>& known) const {
    std::vector<Index> missing;
    for (std::size_t k = 0; k < places.size(); ++k) {
      if (!known[static_cast<std::size_t>(places[k])]) missing.push_back(static_cast<Index>(k));
    }
    const std::vector<Information> found = left_beside(
        view, square, {waves.sine(Eigen::all, missing), waves.cosine(Eigen::all, missing)});
    for (std::size_t k = 0; k < missing.size(); ++k)
      known[static_cast<std::size_t>(places[static_cast<std::size_t>(missing[k])])] = found[k];
    std::vector<Information> all;
    for (const Index place : places) all.push_back(*known[static_cast<std::size_t>(place)]);
    return all;
  }
  static void improve(const Shares& shares, const VectorXd& orders, const Waves& waves,
                      const std::vector<Information>& information, std::vector<Best>& best) {
    const MatrixXd sine_along = transposed_product(shares.along, waves.sine);
    const MatrixXd cosine_along = transposed_product(shares.along, waves.cosine);
    for (Index k = 0; k < orders.size(); ++k) {
      const Information& left = information[static_cast<std::size_t>(k)];
      if (!left.tells()) continue;
      for (Index d = 0; d < shares.along.cols(); ++d) {
        Best& one = best[static_cast<std::size_t>(d)];
        const double strength = left.strength(sine_along(d, k), cosine_along(d, k));
        if (strength > one.strength) one = {.strength = strength, .freedom = 2, .order = orders(k)};
      }
    }
  }

  const LinearProblem& problem_;
  const Cause cause_;
  const int joint_;
  const std::string name_ = fmt::format("joint {}", joint_);  // of its column among the families
  VectorXd q_;
  double step_ = 0;
  Waves turn_;  // the rotation by one step
  Index orders_ = 0;
  BesideBackground<std::vector<std::optional<Information>>> left_;  // of every order asked for
};

}  // namespace

FamilyPtr make_order_family(const LinearProblem& problem, Cause cause) {
  auto family = std::make_unique<OrderFamily>(problem, std::move(cause));
  if (!family->moves()) return nullptr;
  return family;
}

Periodogram periodogram(const LinearProblem& problem, int joint, const Background& background) {
  Cause of_joint;
  of_joint.joint = joint;
  return OrderFamily(problem, of_joint).periodogram_of(background);
}

}  // namespace trammel::cause_search
