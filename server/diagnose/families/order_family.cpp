#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnose/families/family.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAmplitude = 1e-3;    // rad, prior: wide, the data choose
constexpr double kLowestOrder = 2;     // below lie eccentricity and geometry
constexpr double kHighestOrder = 200;  // cycles a joint turn
constexpr double kStep = 0.2;          // of what two orders differ by that the joint's range just tells apart
constexpr double kFineSteps = 5;       // to a coarse one, about the best
constexpr double kTypicalOrder = 50;   // cycles a joint turn: to speak of a gear where none was found
constexpr Index kOrdersAtATime = 96;

class OrderFamily final : public Family {
 public:
  OrderFamily(const LinearProblem& problem, Cause cause)
      : problem_(problem), cause_(std::move(cause)), joint_(cause_.joint) {
    q_.resize(problem.poses());
    for (Index i = 0; i < q_.size(); ++i)
      q_(i) = problem.batch().measurements[static_cast<std::size_t>(i)].context.q(joint_);
    const double span = q_.maxCoeff() - q_.minCoeff();
    step_ = kStep * 2 * kPi / std::max(span, thresholds::kSmallestSpan);
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
    const Shares shares = shares_of(problem_, view, kAmplitude * problem_.by_joint().col(joint_), projected);
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    for (Index first = 0; first < orders_; first += kOrdersAtATime) {
      scan_orders(shares, kLowestOrder + step_ * static_cast<double>(first), step_,
                  std::min(kOrdersAtATime, orders_ - first), best);
    }
    // Once more about the best of the data itself, which stands in the first column.
    if (projected.cols() == 1) {
      const double fine = step_ / kFineSteps;
      const double from = std::max(kLowestOrder, best[0].order - step_);
      scan_orders(shares, from, fine, static_cast<Index>(2 * kFineSteps) + 1, best);
    }
    for (Best& one : best) one.evidence = log_evidence(one.strength, one.freedom);
    return best;
  }

  Periodogram all_orders(const Background& background) const {
    const MatrixXd projected = background.project(problem_.residual());
    const Shares shares = shares_of(problem_, {background}, kAmplitude * problem_.by_joint().col(joint_), projected);
    Periodogram periodogram{joint_, VectorXd(orders_), VectorXd(orders_), 0};
    for (Index k = 0; k < orders_; ++k) {
      std::vector<Best> best(1);
      periodogram.order(k) = kLowestOrder + step_ * static_cast<double>(k);
      scan_orders(shares, periodogram.order(k), step_, 1, best);
      periodogram.strength(k) = best[0].strength;
    }
    return periodogram;
  }

 private:
  /// `count` orders from `from`, `step` apart; improves `best` where one is stronger.
  void scan_orders(const Shares& shares, double from, double step, Index count, std::vector<Best>& best) const {
    MatrixXd sine(q_.size(), count), cosine(q_.size(), count);
    const ArrayXd turn_sine = (step * q_.array()).sin();
    const ArrayXd turn_cosine = (step * q_.array()).cos();
    ArrayXd s = (from * q_.array()).sin();
    ArrayXd c = (from * q_.array()).cos();
    for (Index k = 0; k < count; ++k) {
      sine.col(k) = s;
      cosine.col(k) = c;
      const ArrayXd next = s * turn_cosine + c * turn_sine;
      c = c * turn_cosine - s * turn_sine;
      s = next;
    }
    const MatrixXd sine_along = transposed_product(shares.along, sine);
    const MatrixXd cosine_along = transposed_product(shares.along, cosine);
    const MatrixXd sine_root = transposed_product(shares.root, sine);
    const MatrixXd cosine_root = transposed_product(shares.root, cosine);
    for (Index k = 0; k < count; ++k) {
      // 1: the prior's share.
      const double ss = 1 + sine.col(k).cwiseAbs2().dot(shares.square) - sine_root.col(k).squaredNorm();
      const double cc = 1 + cosine.col(k).cwiseAbs2().dot(shares.square) - cosine_root.col(k).squaredNorm();
      const double sc =
          sine.col(k).cwiseProduct(cosine.col(k)).dot(shares.square) - sine_root.col(k).dot(cosine_root.col(k));
      const double determinant = ss * cc - sc * sc;
      if (!(determinant > 0)) continue;
      const auto a = sine_along.col(k).array();
      const auto b = cosine_along.col(k).array();
      const ArrayXd strength = (cc * a * a - 2 * sc * a * b + ss * b * b) / determinant;
      for (Index d = 0; d < strength.size(); ++d) {
        Best& one = best[static_cast<std::size_t>(d)];
        if (strength(d) > one.strength) {
          one = {.strength = strength(d), .freedom = 2, .order = from + step * static_cast<double>(k)};
        }
      }
    }
  }

  const LinearProblem& problem_;
  const Cause cause_;
  const int joint_;
  VectorXd q_;
  double step_ = 0;
  Index orders_ = 0;
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
  return OrderFamily(problem, of_joint).all_orders(background);
}

}  // namespace trammel::cause_search
