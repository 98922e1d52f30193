#include "server/bias/process/regional_variance.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "server/bias/process/halves.h"
#include "server/numerics/numerics.h"
#include "server/numerics/seeded_random.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kPointsOfARegion = 24;  // at most; P of a smaller region has fewer rows, but there are more of them
constexpr double kMostMissing = 2;      // times the tolerance, at a target, as the draws estimate it
constexpr Index kDrawn = 24;

constexpr Index kFirstPoints = 384;    // of a region: more take longer to read, fewer say less
constexpr double kLastPart = 0.25;     // of the points; where these still tell something, more are taken
constexpr double kLastTells = 0.5;     // times the tolerance: the mean over the samples
constexpr double kMorePoints = 1.4;    // times as many
constexpr double kWorthwhile = 0.33;   // of what the exact variance reads: with more, little time would be saved
constexpr Index kTargetsAtATime = 16;  // their covariances stay in the first-level cache
constexpr Index kRowsAtATime = 4 * kRowPadding;

// Samples, for each training pose.
constexpr std::size_t kBetween = 2;   // on the way from the pose to another one
constexpr std::size_t kAnywhere = 8;  // in the range of the poses
constexpr std::size_t kOfEach = 2 + kBetween + kAnywhere;
constexpr std::size_t kMostSamples = 240;  // of a region
constexpr double kNear = 0.02;             // of a joint's range: what is asked near a training pose
constexpr double kMargin = 0.05;           // of it: what still counts as in domain (domain.cpp)

/// Box & Muller, Annals of Mathematical Statistics 29, 1958.
double normal(SeededRandom* random) {
  const double radius = std::sqrt(-2 * std::log(1 - random->uniform(0, 1)));
  return radius * std::cos(2 * std::numbers::pi * random->uniform(0, 1));
}

// Of the standard deviation of a measurement, when its variance rises by `share` of it.
double rise(double share) { return std::sqrt(1 + std::max(share, 0.0)) - 1; }

}  // namespace

/// The process conditioned on some of its points, and what it says of the samples.
struct RegionalVariance::Fit {
  std::vector<Index> points;
  AlignedMatrix features;  // of the points
  AlignedMatrix root;      // G, zero above the diagonal
  AlignedMatrix t;         // G k, a column for each sample
  VectorXd explained;      // |t|²
  VectorXd weight;         // 1 / variance of a measurement
};

RegionalVariance::RegionalVariance(KernelPtr kernel, VectorXd parameters, MatrixXd q, VectorXd noise, double tolerance)
    : kernel_(std::move(kernel)),
      parameters_(std::move(parameters)),
      q_(std::move(q)),
      noise_(std::move(noise)),
      tolerance_(tolerance) {
  const VectorXd least = q_.colwise().minCoeff();
  const VectorXd most = q_.colwise().maxCoeff();
  low_ = least - kMargin * (most - least);
  high_ = most + kMargin * (most - least);
  features_ = features_of(q_);
  const MatrixXd seen = joints_as_seen_by(*kernel_, parameters_, q_);
  for (const std::vector<Index>& part : halved(seen, kPointsOfARegion)) {
    const MatrixXd members = seen(part, Eigen::all);
    Index middle = 0;
    (members.rowwise() - members.colwise().mean()).rowwise().squaredNorm().minCoeff(&middle);
    centres_.push_back(part[static_cast<std::size_t>(middle)]);
  }
  centre_features_ = features_at(centres_);
  all_ = std::make_unique<Region[]>(centres_.size());
}

AlignedMatrix RegionalVariance::features_of(const MatrixXd& q) const {
  AlignedMatrix table(padded_rows(q.rows()), kernel_->feature_count(q.cols()));
  kernel_->features(parameters_, q, table.data(), table.rows());
  return table;
}

AlignedMatrix RegionalVariance::features_at(const std::vector<Index>& points) const {
  AlignedMatrix table(padded_rows(static_cast<Index>(points.size())), features_.cols());
  table.map().topRows(static_cast<Index>(points.size())) = features_.map()(points, Eigen::all);
  return table;
}

// A target belongs to the region whose centre it has most in common with.
std::vector<std::size_t> RegionalVariance::regions_of(const FeatureBlock& targets) const {
  const auto count = static_cast<Index>(centres_.size());
  AlignedMatrix cross(padded_rows(count), kTargetsAtATime);
  std::vector<std::size_t> regions;
  for (Index first = 0; first < targets.rows; first += kTargetsAtATime) {
    const Index many = std::min(kTargetsAtATime, targets.rows - first);
    kernel_->tile(parameters_, rows_of(centre_features_, 0, count), {targets.data + first, many, targets.ld},
                  cross.data(), cross.rows());
    for (Index j = 0; j < many; ++j) {
      Index best = 0;
      cross.map().col(j).head(count).maxCoeff(&best);
      regions.push_back(static_cast<std::size_t>(best));
    }
  }
  return regions;
}

VectorXd RegionalVariance::sample(std::size_t number) const {
  const auto n = static_cast<std::size_t>(q_.rows());
  SeededRandom random(number);
  const VectorXd pose = q_.row(static_cast<Index>(number % n));
  const std::size_t kind = number / n;
  VectorXd q(q_.cols());
  if (kind >= 2 && kind < 2 + kBetween) {
    const VectorXd other = q_.row(static_cast<Index>(random.next() % n));
    return pose + random.uniform(0, 1) * (other - pose);
  }
  for (Index j = 0; j < q.size(); ++j) {
    const double range = high_[j] - low_[j];
    q[j] = kind >= 2 ? random.uniform(low_[j], high_[j])
                     : pose[j] + static_cast<double>(kind) * kNear * range * random.uniform(-1, 1);
  }
  return q;
}

void RegionalVariance::assign_samples() const {
  const std::size_t count = kOfEach * static_cast<std::size_t>(q_.rows());
  MatrixXd all(static_cast<Index>(count), q_.cols());
  for (std::size_t i = 0; i < count; ++i) all.row(static_cast<Index>(i)) = sample(i).transpose();
  const AlignedMatrix features = features_of(all);
  const std::vector<std::size_t> regions = regions_of(rows_of(features, 0, all.rows()));
  samples_.resize(centres_.size());
  for (std::size_t i = 0; i < count; ++i) samples_[regions[i]].push_back(i);
}

// With independent ξ ~ N(0, 1), M⁻¹ y = Gᵀ ξ and y = M Gᵀ ξ have the covariances M⁻¹ and M.
void RegionalVariance::draw_data(const VarianceTable& exact) const {
  const Index n = q_.rows();
  MatrixXd weights = MatrixXd::Zero(n, kDrawn);
  {
    const std::vector<double> rows = exact.rows(0);
    SeededRandom random(1);
    Eigen::RowVectorXd drawn(kDrawn);
    for (Index i = 0; i < n; ++i) {
      for (double& value : drawn) value = normal(&random);
      weights.topRows(i + 1) += Eigen::Map<const VectorXd>(rows.data() + i * (i + 1) / 2, i + 1) * drawn;
    }
  }
  weights = weights.cast<float>().cast<double>();
  data_ = noise_.asDiagonal() * weights;
  AlignedMatrix cross(padded_rows(n), kTargetsAtATime);
  for (Index first = 0; first < n; first += kTargetsAtATime) {
    const Index many = std::min(kTargetsAtATime, n - first);
    kernel_->tile(parameters_, rows_of(features_, 0, n), rows_of(features_, first, many), cross.data(), cross.rows());
    MatrixXd part(many, kDrawn);
    numerics().transposed_product(n, many, cross.data(), cross.rows(), kDrawn, weights.data(), n, part.data(), many);
    data_.middleRows(first, many) += part;
  }
  weights_ = packed(weights.transpose());
}

MatrixXd RegionalVariance::samples_in(std::size_t region) const {
  const std::vector<std::size_t>& numbers = samples_[region];
  const std::size_t step = (numbers.size() + kMostSamples - 1) / kMostSamples;
  MatrixXd q(static_cast<Index>(step == 0 ? 0 : (numbers.size() + step - 1) / step), q_.cols());
  for (Index i = 0; i < q.rows(); ++i) q.row(i) = sample(numbers[static_cast<std::size_t>(i) * step]).transpose();
  return q;
}

std::vector<Index> RegionalVariance::ranked(const AlignedMatrix& samples, Index count) const {
  const Index n = q_.rows();
  AlignedMatrix cross(padded_rows(n), kTargetsAtATime);
  VectorXd common = VectorXd::Zero(n);
  for (Index first = 0; first < count; first += kTargetsAtATime) {
    const Index many = std::min(kTargetsAtATime, count - first);
    kernel_->tile(parameters_, rows_of(features_, 0, n), rows_of(samples, first, many), cross.data(), cross.rows());
    common += cross.map().topLeftCorner(n, many).array().square().square().rowwise().sum().matrix();
  }
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return common[a] > common[b]; });
  return order;
}

AlignedMatrix RegionalVariance::covariance_of(const Fit& fit) const {
  const auto m = static_cast<Index>(fit.points.size());
  AlignedMatrix matrix = factor_storage(m);
  const FeatureBlock own = rows_of(fit.features, 0, m);
  kernel_->tile(parameters_, own, own, matrix.data(), matrix.rows());
  matrix.map().bottomRows(matrix.rows() - m).setZero();
  matrix.map().diagonal().head(m) += noise_(fit.points);
  return matrix;
}

std::unique_ptr<RegionalVariance::Fit> RegionalVariance::fit(const std::vector<Index>& points,
                                                             const AlignedMatrix& samples, Index count) const {
  const auto m = static_cast<Index>(points.size());
  auto fit = std::make_unique<Fit>();
  fit->points = points;
  fit->features = features_at(points);
  fit->root = covariance_of(*fit);
  AlignedMatrix work(numerics().work_size(m), 1);
  double log_det = 0;
  if (!numerics().inverse_root(m, 0, fit->root.data(), fit->root.rows(), work.data(), &log_det)) return nullptr;
  for (Index j = 1; j < m; ++j) fit->root.map().col(j).head(j).setZero();
  fit->root.map().bottomRows(fit->root.rows() - m).setZero();

  AlignedMatrix cross(padded_rows(count), m);
  kernel_->tile(parameters_, rows_of(samples, 0, count), rows_of(fit->features, 0, m), cross.data(), cross.rows());
  fit->t = {padded_rows(m), padded_rows(count)};
  AlignedMatrix product(numerics().multiply_work_size(kRowsAtATime, count), 1);
  for (Index i = 0; i < m; i += kRowsAtATime) {
    const Index rows = std::min(kRowsAtATime, m - i);
    numerics().multiply_transposed(rows, count, i + rows, 1.0, fit->root.data() + i, fit->root.rows(), cross.data(),
                                   cross.rows(), false, fit->t.data() + i, fit->t.rows(), product.data());
  }
  const auto t = fit->t.map().topLeftCorner(m, count);
  fit->explained = t.colwise().squaredNorm().transpose();
  VectorXd prior(count);
  kernel_->diagonal(parameters_, rows_of(samples, 0, count), prior.data());
  fit->weight = ((prior - fit->explained).cwiseMax(0.0).array() + noise_.mean()).inverse();
  return fit;
}

// Pivoted Cholesky of the samples' tᵀt: always the sample whose variance of a measurement is farthest off.
MatrixXd RegionalVariance::directions(const Fit& fit) const {
  const auto m = static_cast<Index>(fit.points.size());
  const Index count = fit.explained.size();
  const auto t = fit.t.map().topLeftCorner(m, count);
  const auto all = static_cast<double>(q_.rows());
  // In bytes: a float of P beside a double of the triangle G of all points.
  const auto most = static_cast<Index>(kWorthwhile * all * all / static_cast<double>(m));
  VectorXd left = fit.explained;
  MatrixXd lower(count, std::min(most, count));
  std::vector<Index> taken;
  while (true) {
    Index worst = 0;
    const double share = left.cwiseProduct(fit.weight).maxCoeff(&worst);
    if (rise(share) <= tolerance_) break;
    const auto j = static_cast<Index>(taken.size());
    if (j == lower.cols()) return {};
    lower.col(j) = (t.transpose() * t.col(worst) - lower.leftCols(j) * lower.row(worst).head(j).transpose()) /
                   std::sqrt(left[worst]);
    left -= lower.col(j).cwiseAbs2();
    for (const Index before : taken) left[before] = 0;
    left[worst] = 0;
    taken.push_back(worst);
  }
  const auto d = static_cast<Index>(taken.size());
  const MatrixXd chosen = t(Eigen::all, taken);
  MatrixXd P(m, d);
  numerics().transposed_product(m, m, fit.root.data(), fit.root.rows(), d, chosen.data(), m, P.data(), m);
  const MatrixXd factor = lower(taken, Eigen::seqN(0, d));
  factor.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(P);
  return P.transpose();
}

RegionalVariance::Panels RegionalVariance::packed(const MatrixXd& a) {
  Panels panels{a.rows(), a.cols(), {}};
  panels.packed.resize(static_cast<std::size_t>(numerics().panel_size(a.rows(), a.cols())));
  numerics().pack_panels(a.rows(), a.cols(), a.data(), a.rows(), panels.packed.data());
  return panels;
}

// With F the largest sum of a row of |P M Pᵀ - I|, PᵀP / (1 + F) <= M⁻¹ (Gershgorin), whatever was rounded.
void RegionalVariance::keep(const Fit& fit, const MatrixXd& P, Region* region) const {
  const Index m = P.cols();
  const Index d = P.rows();
  region->exact = false;
  region->checked = MatrixXd::Zero(d, kDrawn);
  if (d == 0) return;
  const MatrixXd rounded = P.transpose().cast<float>().cast<double>();
  const AlignedMatrix M = covariance_of(fit);
  MatrixXd product(m, d);
  numerics().transposed_product(m, m, M.data(), M.rows(), d, rounded.data(), m, product.data(), m);
  MatrixXd beyond(d, d);
  numerics().transposed_product(m, d, rounded.data(), m, d, product.data(), m, beyond.data(), d);
  beyond.diagonal().array() -= 1.0;
  region->factor = 1.0 / (1.0 + beyond.cwiseAbs().rowwise().sum().maxCoeff());
  const double lost = (1.0 - region->factor) * fit.explained.cwiseProduct(fit.weight).maxCoeff();
  region->exact = !(rise(lost) <= tolerance_);
  if (region->exact) return;
  region->points = fit.points;
  region->P = packed(P);
  region->checked = rounded.transpose() * data_(fit.points, Eigen::all);
}

void RegionalVariance::build(std::size_t index) const {
  const MatrixXd q = samples_in(index);
  if (q.rows() == 0) return;
  const AlignedMatrix samples = features_of(q);
  const std::vector<Index> order = ranked(samples, q.rows());
  Region& region = all_[index];
  std::size_t count = std::min<std::size_t>(kFirstPoints, order.size());
  while (true) {
    const auto tried = fit({order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count)}, samples, q.rows());
    if (!tried) return;
    const auto last = static_cast<Index>(kLastPart * static_cast<double>(count));
    const VectorXd added =
        tried->t.map().block(static_cast<Index>(count) - last, 0, last, q.rows()).colwise().squaredNorm().transpose();
    if (count < order.size() && rise(added.cwiseProduct(tried->weight).mean()) > kLastTells * tolerance_) {
      count = std::min(order.size(), static_cast<std::size_t>(kMorePoints * static_cast<double>(count)));
      continue;
    }
    const MatrixXd P = directions(*tried);
    if (P.cols() == 0) return;
    keep(*tried, P, &region);
    return;
  }
}

void RegionalVariance::prepare(const VarianceTable& exact, std::size_t index) const {
  std::call_once(drawn_, [&] {
    assign_samples();
    draw_data(exact);
  });
  std::call_once(all_[index].built, [&] { build(index); });
}

std::optional<double> RegionalVariance::left_of(const Region& region, const double* k, double prior) const {
  if (region.exact) return std::nullopt;
  const Panels& P = region.P;
  VectorXd of_data(padded_rows(kDrawn));
  numerics().panel_product(weights_.rows, weights_.cols, weights_.packed.data(), k, of_data.data());
  VectorXd near(P.cols);
  for (Index i = 0; i < P.cols; ++i) near[i] = k[region.points[static_cast<std::size_t>(i)]];
  VectorXd of_region(padded_rows(P.rows));
  numerics().panel_product(P.rows, P.cols, P.packed.data(), near.data(), of_region.data());
  const auto known = of_region.head(P.rows);
  const double left = std::max(prior - region.factor * known.squaredNorm(), 0.0);
  const double missing = (of_data.head(kDrawn) - region.checked.transpose() * known).squaredNorm() / kDrawn;
  if (rise(missing / (std::max(left - missing, 0.0) + noise_.mean())) > kMostMissing * tolerance_) return std::nullopt;
  return left;
}

void RegionalVariance::shares(const VarianceTable& exact, const FeatureBlock& targets, double* posterior,
                              double* prior) const {
  kernel_->diagonal(parameters_, targets, prior);
  const std::vector<std::size_t> regions = regions_of(targets);
  std::vector<Index> order(regions.size());
  std::iota(order.begin(), order.end(), Index{0});
  // Region by region: its P stays in the cache.
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
    return regions[static_cast<std::size_t>(a)] < regions[static_cast<std::size_t>(b)];
  });
  AlignedMatrix k(features_.rows(), 1);
  std::vector<Index> doubtful;
  for (const Index i : order) {
    const std::size_t index = regions[static_cast<std::size_t>(i)];
    prepare(exact, index);
    kernel_->tile(parameters_, rows_of(features_, 0, q_.rows()), {targets.data + i, 1, targets.ld}, k.data(), k.rows());
    const std::optional<double> left = left_of(all_[index], k.data(), prior[i]);
    posterior[i] = left.value_or(prior[i]);
    if (!left) doubtful.push_back(i);
  }
  if (doubtful.empty()) return;
  const auto count = static_cast<Index>(doubtful.size());
  MatrixXd gathered(count, features_.cols());
  for (Index i = 0; i < count; ++i) {
    for (Index f = 0; f < gathered.cols(); ++f)
      gathered(i, f) = targets.data[doubtful[static_cast<std::size_t>(i)] + f * targets.ld];
  }
  VectorXd left(count);
  VectorXd before(count);
  exact.shares(*kernel_, parameters_, rows_of(gathered, 0, count), left.data(), before.data());
  for (Index i = 0; i < count; ++i) posterior[doubtful[static_cast<std::size_t>(i)]] = left[i];
}

}  // namespace trammel
