#include "server/bias/coupled/coupled_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bias/search/starts.h"
#include "server/numerics/seeded_random.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMediumPoints = 400;    // a step between the first searches and all points
constexpr int kMostStarts = 6;          // each takes as long as twenty of a plain process
constexpr double kSmallestLog = -21.0;  // of σ_f, m: 1 nm, for an output that is zero

CoupledData subset(const CoupledData& data, const std::vector<Index>& order, Index count) {
  const std::vector<Index> rows(order.begin(), order.begin() + count);
  CoupledData part{data.q(rows, Eigen::all), data.y(rows, Eigen::all), data.noise_shape(rows), {}};
  for (const MatrixXd& columns : data.columns) part.columns.emplace_back(columns(rows, Eigen::all));
  return part;
}

// One search in progress.
class CoupledSearch {
 public:
  CoupledSearch(std::shared_ptr<const Kernel> kernel, const LinearBlocks& blocks, const CoupledData& data,
                const VectorXd& metrology_stddev, bool shared_scales, const SearchOptions& options)
      : kernel_(std::move(kernel)),
        blocks_(blocks),
        data_(data),
        shared_scales_(shared_scales),
        options_(options),
        random_(options.seed),
        box_(kernel_->search_box(data.q)),
        order_(shuffled_rows(data.q.rows(), &random_)) {
    prior_.noise_stddev = metrology_stddev;
    prior_.parameter_centre = 0.5 * (box_.low + box_.high);
    prior_.signal_centre = (data.y.colwise().squaredNorm() / static_cast<double>(data.q.rows()))
                               .array()
                               .sqrt()
                               .log()
                               .max(kSmallestLog)
                               .transpose();
    prior_.signal_centre.array() -= 1.0;  // the blocks explain the larger part
  }

  std::optional<CoupledSearchResult> run(const CoupledHyperparameters* last) {
    if (last != nullptr) {
      result_.starts_at_best = 1;
      result_.found = improved(*last, all(), shared_scales_, {.max_evaluations = 10, .tolerance = 0.3}, 1.0);
      return result_;
    }
    std::optional<CoupledHyperparameters> best = from_several_starts();
    if (result_.given_up) return result_;
    if (!best) return std::nullopt;
    const Index medium = std::min(all(), kMediumPoints);
    if (medium > kStartPoints) best = improved(*best, medium, true, {.max_evaluations = 25, .tolerance = 0.1}, 0.5);
    if (all() > medium) best = improved(*best, all(), true, {.max_evaluations = 8, .tolerance = 0.3}, 0.7);
    if (!shared_scales_) best = improved(*best, all(), false, {.max_evaluations = 10, .tolerance = 0.3}, 0.95);
    report(1.0);
    result_.found = *best;
    return result_;
  }

 private:
  Index all() const { return data_.q.rows(); }

  void report(double share) {
    if (options_.progress && !options_.progress(share)) result_.given_up = true;
  }

  CoupledLikelihood likelihood(Index count, bool shared) {
    prior_.shared_scales = shared;
    return {kernel_, blocks_, subset(data_, order_, count), prior_};
  }

  VectorXd random_start() {
    const Index outputs = data_.y.cols();
    CoupledHyperparameters start;
    VectorXd scales(box_.low.size());
    for (Index k = 0; k < scales.size(); ++k) scales[k] = random_.uniform(box_.low[k], box_.high[k]);
    const double signal = random_.uniform(-3.0, 1.0);
    for (Index d = 0; d < outputs; ++d)
      start.outputs.push_back({scales, prior_.signal_centre[d] + signal, std::log(1.5 * prior_.noise_stddev[d])});
    start.blocks = blocks_.start();
    return likelihood(1, true).pack(start);
  }

  BfgsResult improve(const CoupledLikelihood& function, const VectorXd& start, const BfgsOptions& limits) {
    const Objective objective = [&](const VectorXd& x, ObjectiveValue* out) {
      return !result_.given_up && function.evaluate(x, out);
    };
    const double curvature = 0.05 * static_cast<double>(function.size());
    BfgsResult found = minimise(objective, start, MatrixXd::Identity(start.size(), start.size()) / curvature, limits);
    if (function.size() == all()) result_.evaluations += found.evaluations;
    return found;
  }

  std::optional<CoupledHyperparameters> from_several_starts() {
    const CoupledLikelihood small = likelihood(std::min(all(), kStartPoints), true);
    const int starts = std::clamp(options_.starts, 1, kMostStarts);
    std::vector<BfgsResult> ends;
    for (int s = 0; s < starts && !result_.given_up; ++s) {
      BfgsResult end = improve(small, random_start(), {.max_evaluations = 60, .tolerance = 0.02});
      if (end.defined) ends.push_back(std::move(end));
      report(0.3 * (s + 1) / starts);
    }
    if (ends.empty()) return std::nullopt;
    std::stable_sort(ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.value < b.value; });
    for (const BfgsResult& end : ends) result_.starts_at_best += end.value < ends.front().value + kSameOptimum;
    return small.unpack(ends.front().x);
  }

  CoupledHyperparameters improved(const CoupledHyperparameters& from, Index count, bool shared,
                                  const BfgsOptions& limits, double share_done) {
    if (result_.given_up) return from;
    const CoupledLikelihood function = likelihood(count, shared);
    const BfgsResult found = improve(function, function.pack(from), limits);
    report(share_done);
    return found.defined ? function.unpack(found.x) : from;
  }

  std::shared_ptr<const Kernel> kernel_;
  const LinearBlocks& blocks_;
  const CoupledData& data_;
  bool shared_scales_;
  const SearchOptions& options_;
  SeededRandom random_;
  SearchBox box_;
  std::vector<Index> order_;
  CoupledPrior prior_;
  CoupledSearchResult result_;
};

}  // namespace

std::optional<CoupledSearchResult> search_coupled(const std::shared_ptr<const Kernel>& kernel,
                                                  const LinearBlocks& blocks, const CoupledData& data,
                                                  const VectorXd& metrology_stddev, bool shared_scales,
                                                  const SearchOptions& options, const CoupledHyperparameters* last) {
  return CoupledSearch(kernel, blocks, data, metrology_stddev, shared_scales, options).run(last);
}

}  // namespace trammel
