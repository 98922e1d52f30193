#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnose/families/family.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kBox = 1.2;  // half width of the box that the basis lives in; data lie in [-1, 1]
constexpr Index kFunctionsOfOne = 16;
constexpr Index kFunctionsOfEach = 7;                      // of two
constexpr Index kSlowFunctions = 8;                        // of time: faster functions are not slow
constexpr double kLeastTime = 1e-6;                        // s
constexpr Index kHarmonics[] = {4, 6, 9, 14, 21, 32, 48};  // per turn of the joint, all of one size
constexpr double kTelling = 1e-4;  // of the largest deviation: functions below this are left out
constexpr int kSizes = 17;         // a quarter of a decade apart
constexpr double kSizeRatio = 1.7782794100389228;  // 10^(1/4)

/// Angular frequency of a sine of the box.
double frequency(Index k) { return kPi * static_cast<double>(k + 1) / (2 * kBox); }

/// N x count: sines in a box. Weighed by deviations() their random sums are a Gaussian process with
/// a squared exponential kernel of unit variance (Solin and Särkkä 2020).
MatrixXd sines(const VectorXd& x, Index count) {
  MatrixXd functions(x.size(), count);
  for (Index k = 0; k < count; ++k)
    functions.col(k) = (frequency(k) * (x.array() + kBox)).sin() / std::sqrt(kBox);
  return functions;
}
VectorXd deviations(Index count, double length_scale) {
  VectorXd spectrum(count);
  for (Index k = 0; k < count; ++k) {
    spectrum(k) = std::sqrt(2 * kPi) * length_scale *
                  std::exp(-0.5 * std::pow(length_scale * frequency(k), 2));
  }
  return spectrum.cwiseSqrt();
}

/// [-1, 1] over the poses; empty where it hardly changes.
VectorXd spread(const VectorXd& x, double smallest) {
  const double low = x.minCoeff();
  const double high = x.maxCoeff();
  if (high - low < smallest) return {};
  return 2 * (x.array() - low) / (high - low) - 1;
}

VectorXd angles(const LinearProblem& problem, int joint) {
  VectorXd q(problem.poses());
  for (Index i = 0; i < q.size(); ++i) q(i) = problem.gear_angles(i)(joint);
  return q;
}

/// Numbers of variance v whose information is tridiagonal: log det (1 + v T), the trace of v T (1 +
/// v T)⁻¹, and v yᵀ (1 + v T)⁻¹ y of every row y of the data.
struct AtSize {
  double cost = 0, freedom = 0;
  VectorXd strength;
};
AtSize at_size(const VectorXd& diagonal, const VectorXd& beside, double variance,
               const MatrixXd& data) {
  const Index n = diagonal.size();
  AtSize at{0, static_cast<double>(n), VectorXd::Zero(data.rows())};
  const VectorXd own = 1 + variance * diagonal.array();
  const VectorXd coupling = variance * beside;
  // 1 + v T = L D Lᵀ from above, and U E Uᵀ from below; its inverse has the diagonal 1 / (d + e -
  // own).
  VectorXd above = own, below = own;
  for (Index i = 1; i < n; ++i) above(i) -= coupling(i - 1) * coupling(i - 1) / above(i - 1);
  for (Index i = n - 2; i >= 0; --i) below(i) -= coupling(i) * coupling(i) / below(i + 1);
  at.cost = above.array().log().sum();
  at.freedom -= (above + below - own).cwiseInverse().sum();
  VectorXd y = VectorXd::Zero(data.rows());
  for (Index i = 0; i < n; ++i) {
    y = data.col(i) - (i > 0 ? coupling(i - 1) / above(i - 1) : 0.0) * y;
    at.strength += (variance / above(i)) * y.cwiseAbs2();
  }
  return at;
}

/// A random smooth function of the pose, times one or more columns g: numbers are wanted for every
/// g and every function. Its length scale and its size are chosen by the data.
class SmoothFamily : public Family {
 public:
  explicit SmoothFamily(const LinearProblem& problem) : problem_(problem) {}

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const final {
    const std::size_t scales = scales_looked_for();
    const Index each = deviations_[scales - 1].size();
    const MatrixXd functions = functions_.leftCols(each);
    const std::vector<AtScale>& known =
        known_.of(view, [&] { return scales_beside(view, projected, functions); });
    MatrixXd along(static_cast<Index>(g_.size()) * each, projected.cols());
    for (std::size_t s = 0; s < g_.size(); ++s) {
      along.middleRows(static_cast<Index>(s) * each, each) =
          pose_by_pose_
              ? transposed_product(functions,
                                   shares_of(problem_, view, g_names_[s], g_[s], projected).along)
              : transposed_product(times_functions(kept(view, s), functions), projected);
    }
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    for (std::size_t scale = 0; scale < scales; ++scale) choose(known[scale], along, scale, best);
    return best;
  }

  MatrixXd columns(const Best& best) const final {
    const VectorXd& deviation = deviations_[best.length_scale];
    const Index each = deviation.size();
    const MatrixXd functions = best.size * functions_.leftCols(each) * deviation.asDiagonal();
    MatrixXd all(problem_.rows(), static_cast<Index>(g_.size()) * each);
    for (std::size_t s = 0; s < g_.size(); ++s)
      all.middleCols(static_cast<Index>(s) * each, each) = times_functions(g_[s], functions);
    return all;
  }
  Best typical() const final {
    return {.freedom = 1, .length_scale = scales_looked_for() - 1, .size = typical_};
  }

 protected:
  const LinearProblem& problem_;
  std::vector<VectorXd> g_;           // R each
  std::vector<std::string> g_names_;  // the name of each among the families
  MatrixXd functions_;                // N x k
  std::size_t looked_for_ = 0;        // the number of length scales to search; 0: all
  std::vector<VectorXd>
      deviations_;  // for each length scale, the deviations of the first functions, which it uses
  double smallest_ = 1e-6;
  double typical_ = 1e-4;
  bool pose_by_pose_ = true;  // g is shared with other families, or there are many functions

 private:
  [[nodiscard]] std::size_t scales_looked_for() const {
    return looked_for_ > 0 ? looked_for_ : deviations_.size();
  }
  /// R x functions: g(row) f(pose).
  MatrixXd times_functions(const VectorXd& g, const MatrixXd& functions) const {
    MatrixXd all(problem_.rows(), functions.cols());
    for (Index i = 0; i < problem_.poses(); ++i) {
      const Index row = problem_.first_row(i);
      const Index count = problem_.row_count(i);
      all.middleRows(row, count).noalias() = g.segment(row, count) * functions.row(i);
    }
    return all;
  }
  VectorXd kept(const View& view, std::size_t s) const {
    return view.keep ? VectorXd(view.keep->cwiseProduct(g_[s])) : g_[s];
  }
  /// The numbers that tell at a length scale, and their information Q T Qᵀ beside the background,
  /// at size 1. T is tridiagonal: it decides on all sizes without its eigenvalues.
  struct AtScale {
    std::vector<Index> taken;
    VectorXd deviation;
    Eigen::Tridiagonalization<MatrixXd> information;
  };
  std::vector<AtScale> scales_beside(const View& view, const MatrixXd& projected,
                                     const MatrixXd& functions) const {
    const Index each = functions.cols();
    const Index count = static_cast<Index>(g_.size()) * each;
    MatrixXd information = MatrixXd::Zero(count, count);
    MatrixXd across(view.background.root().cols(), count);
    for (std::size_t s = 0; s < g_.size(); ++s) {
      const Index first = static_cast<Index>(s) * each;
      auto own = information.block(first, first, each, each);
      if (!pose_by_pose_) {
        const MatrixXd whole = times_functions(kept(view, s), functions);
        across.middleCols(first, each) = transposed_product(view.background.root(), whole);
        own = gram(whole);
        continue;
      }
      const VectorXd& square = shares_of(problem_, view, g_names_[s], g_[s], projected).square;
      across.middleCols(first, each) =
          transposed_product(root_shares_of(problem_, view, g_names_[s], g_[s]), functions);
      own = gram(square.cwiseSqrt().asDiagonal() * functions);
    }
    information -= gram(across);
    std::vector<AtScale> all;
    for (std::size_t scale = 0; scale < scales_looked_for(); ++scale)
      all.push_back(at_scale(information, scale));
    return all;
  }
  AtScale at_scale(const MatrixXd& information, std::size_t scale) const {
    AtScale at;
    std::vector<Index> telling;
    for (Index k = 0; k < deviations_[scale].size(); ++k) {
      if (deviations_[scale](k) > kTelling * deviations_[scale].maxCoeff()) telling.push_back(k);
    }
    const Index apart = information.cols() / static_cast<Index>(g_.size());
    for (Index first = 0; first < information.cols(); first += apart) {
      for (const Index k : telling) at.taken.push_back(first + k);
    }
    at.deviation =
        VectorXd(deviations_[scale](telling)).replicate(static_cast<Index>(g_.size()), 1);
    at.information.compute(at.deviation.asDiagonal() * information(at.taken, at.taken) *
                           at.deviation.asDiagonal());
    return at;
  }
  void choose(const AtScale& known, const MatrixXd& along, std::size_t scale,
              std::vector<Best>& best) const {
    const MatrixXd turned =
        (known.information.matrixQ().adjoint() *
         MatrixXd(known.deviation.asDiagonal() * along(known.taken, Eigen::all)))
            .transpose();
    const VectorXd diagonal = known.information.diagonal();
    const VectorXd beside = known.information.subDiagonal();
    double size = smallest_;
    for (int step = 0; step < kSizes; ++step, size *= kSizeRatio) {
      const AtSize at = at_size(diagonal, beside, size * size, turned);
      for (Index d = 0; d < at.strength.size(); ++d) {
        Best& one = best[static_cast<std::size_t>(d)];
        const double evidence = 0.5 * (at.strength(d) - at.cost);
        if (evidence > one.evidence) {
          one = {.evidence = evidence,
                 .strength = at.strength(d),
                 .freedom = static_cast<int>(std::ceil(at.freedom)),
                 .length_scale = scale,
                 .size = size};
        }
      }
    }
  }

  BesideBackground<std::vector<AtScale>> known_;
};

class JointMapFamily final : public SmoothFamily {
 public:
  JointMapFamily(const LinearProblem& problem, Cause cause, const VectorXd& q)
      : SmoothFamily(problem), cause_(std::move(cause)) {
    const Index most = std::end(kHarmonics)[-1];
    g_.emplace_back(problem.by_joint().col(cause_.joint));
    g_names_.push_back(fmt::format("joint {}", cause_.joint));
    functions_ = MatrixXd(q.size(), 2 * most);
    for (Index h = 1; h <= most; ++h) {
      functions_.col(2 * h - 2) = (static_cast<double>(h) * q.array()).sin();
      functions_.col(2 * h - 1) = (static_cast<double>(h) * q.array()).cos();
    }
    for (const Index harmonics : kHarmonics) {
      deviations_.emplace_back(
          VectorXd::Constant(2 * harmonics, 1 / std::sqrt(static_cast<double>(harmonics))));
      if (deviations_.size() == 1 || harmonics <= problem.poses() / 10)
        looked_for_ = deviations_.size();
    }
    smallest_ = 1e-7;
    typical_ = 5e-5;
  }
  Cause cause(const Best&) const override { return cause_; }
  std::string source(const Best& best) const override {
    return fmt::format("{}@{}", to_string(cause_), kHarmonics[best.length_scale]);
  }

 private:
  Cause cause_;
};

class AnonymousFamily final : public SmoothFamily {
 public:
  AnonymousFamily(const LinearProblem& problem, std::vector<std::string> on,
                  const std::vector<VectorXd>& x)
      : SmoothFamily(problem), on_(std::move(on)) {
    const Index count = x.size() == 1 ? kFunctionsOfOne : kFunctionsOfEach;
    functions_ = sines(x[0], count);
    if (x.size() == 2) functions_ = products(functions_, sines(x[1], count));
    // A part that is equal at all poses depends on nothing: a shifted base is not a function of a
    // joint.
    functions_.rowwise() -= Eigen::RowVectorXd(functions_.colwise().mean());
    for (const double length_scale : {0.2, 0.45, 1.0}) {
      MatrixXd deviation = deviations(count, length_scale).transpose();
      if (x.size() == 2) deviation = products(deviation, deviation);
      deviations_.emplace_back(deviation.transpose());
    }
    for (Index axis = 0; axis < 3; ++axis) {
      VectorXd g = VectorXd::Zero(problem.rows());
      for (Index i = 0; i < problem.poses(); ++i) {
        const Index row = problem.first_row(i) + axis;
        g(row) = problem.weight()(row);
      }
      g_.push_back(std::move(g));
      g_names_.push_back(fmt::format("axis {}", axis));
    }
  }
  bool named() const override { return false; }
  Cause cause(const Best&) const override { return unknown_cause(); }
  std::vector<std::string> depends_on() const override { return on_; }

 private:
  static MatrixXd products(const MatrixXd& a, const MatrixXd& b) {
    MatrixXd all(a.rows(), a.cols() * b.cols());
    for (Index k = 0; k < a.cols(); ++k) {
      all.middleCols(k * b.cols(), b.cols()) = (b.array().colwise() * a.col(k).array()).matrix();
    }
    return all;
  }
  std::vector<std::string> on_;
};

class SlowFamily final : public SmoothFamily {
 public:
  SlowFamily(const LinearProblem& problem, const MatrixXd& columns, std::string wanderer, int joint,
             const VectorXd& time)
      : SmoothFamily(problem), wanderer_(std::move(wanderer)), joint_(joint) {
    functions_ = sines(time, kSlowFunctions);
    // The mean place belongs to another cause: a zero, a base.
    functions_.rowwise() -= Eigen::RowVectorXd(functions_.colwise().mean());
    for (const double length_scale : {0.3, 0.6, 1.2})
      deviations_.push_back(deviations(kSlowFunctions, length_scale));
    for (Index k = 0; k < columns.cols(); ++k) g_.emplace_back(columns.col(k));
    pose_by_pose_ = false;
    smallest_ = 1e-3;
    typical_ = 1e-2;
  }
  bool named() const override { return false; }
  Cause cause(const Best&) const override { return unknown_cause(joint_); }
  std::string wanderer() const override { return wanderer_; }
  std::vector<std::string> depends_on() const override {
    if (joint_ < 0) return {"time"};
    return {fmt::format("q{}", joint_ + 1), "time"};
  }

 private:
  std::string wanderer_;
  int joint_;
};

/// [-1, 1] over the poses; by the row if some pose has no time. Empty if no time passes.
VectorXd times_of(const LinearProblem& problem) {
  VectorXd time = VectorXd::LinSpaced(problem.poses(), 0, static_cast<double>(problem.poses() - 1));
  const auto& poses = problem.batch().measurements;
  if (std::all_of(poses.begin(), poses.end(),
                  [](const Measurement& m) { return m.context.time.has_value(); })) {
    for (Index i = 0; i < time.size(); ++i)
      time(i) = *poses[static_cast<std::size_t>(i)].context.time;
  }
  return spread(time, kLeastTime);
}

}  // namespace

FamilyPtr make_slow_family(const LinearProblem& problem, const MatrixXd& columns,
                           std::string wanderer, int joint) {
  const VectorXd time = times_of(problem);
  if (time.size() == 0) return nullptr;
  return std::make_unique<SlowFamily>(problem, columns, std::move(wanderer), joint, time);
}

FamilyPtr make_joint_map_family(const LinearProblem& problem, Cause cause) {
  const VectorXd q = angles(problem, cause.joint);
  if (q.maxCoeff() - q.minCoeff() < thresholds::kSmallestSpan) return nullptr;
  return std::make_unique<JointMapFamily>(problem, std::move(cause), q);
}

FamilyPtr make_anonymous_family(const LinearProblem& problem, const std::vector<int>& joints) {
  std::vector<std::string> on;
  std::vector<VectorXd> x;
  for (const int joint : joints) {
    on.push_back(fmt::format("q{}", joint + 1));
    x.push_back(spread(angles(problem, joint), thresholds::kSmallestSpan));
  }
  if (joints.empty()) {
    on.emplace_back("time");
    x.push_back(VectorXd::LinSpaced(problem.poses(), -1, 1));
  }
  if (std::any_of(x.begin(), x.end(), [](const VectorXd& one) { return one.size() == 0; }))
    return nullptr;
  return std::make_unique<AnonymousFamily>(problem, std::move(on), x);
}

}  // namespace trammel::cause_search
