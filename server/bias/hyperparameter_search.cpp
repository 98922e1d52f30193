#include "server/bias/hyperparameter_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kStartPoints = 150;
constexpr Index kCarryPoints = 300;
constexpr double kCarryShare = 0.45;
constexpr int kCarried = 3;
constexpr double kSameOptimum = 0.1;  // nat
constexpr double kWorseLeaveOneOut = 1.1;

// The standard library leaves its distributions and shuffles to the implementation; these give the same model anywhere.
// SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31U);
  }
  double uniform(double low, double high) { return low + (high - low) * static_cast<double>(next() >> 11U) * 0x1p-53; }

 private:
  std::uint64_t state_;
};

std::vector<Index> shuffled(Index n, Random* random) {
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), Index{0});
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random->next() % i]);
  return order;
}

GpData subset(const GpData& data, const std::vector<Index>& order, Index count, Index first_output, Index outputs) {
  GpData part{MatrixXd(count, data.q.cols()), MatrixXd(count, outputs), VectorXd(count)};
  for (Index i = 0; i < count; ++i) {
    const Index row = order[static_cast<std::size_t>(i)];
    part.q.row(i) = data.q.row(row);
    part.y.row(i) = data.y.row(row).segment(first_output, outputs);
    part.noise_shape[i] = data.noise_shape[row];
  }
  return part;
}

// One search in progress: the data in its seeded order, the priors, and what has been counted.
class Search {
 public:
  Search(std::shared_ptr<const Kernel> kernel, const GpData& data, double metrology_stddev,
         const SearchOptions& options)
      : kernel_(std::move(kernel)),
        data_(data),
        options_(options),
        random_(options.seed),
        box_(kernel_->search_box(data.q)) {
    order_ = shuffled(data.q.rows(), &random_);
    prior_.noise_stddev = metrology_stddev;
    prior_.parameter_centre = 0.5 * (box_.low + box_.high);
  }

  std::optional<SearchResult> run() {
    std::vector<Optimum> candidates = from_many_starts();
    if (result_.given_up) return result_;
    if (candidates.empty()) return std::nullopt;
    const Optimum shared = best_when_carried(std::move(candidates));
    for (Index d = 0; d < data_.y.cols() && !result_.given_up; ++d) refine(d, shared);
    return result_;
  }

 private:
  struct Optimum : BfgsResult {
    VectorXd signal_variance;  // of each output at x
  };

  Index all() const { return data_.q.rows(); }

  ProfiledLikelihood likelihood(Index count, Index first_output, Index outputs) const {
    return {kernel_, subset(data_, order_, count, first_output, outputs), prior_};
  }

  void report(double share) {
    if (options_.progress && !options_.progress(share)) result_.given_up = true;
  }

  Optimum improve(ProfiledLikelihood* likelihood, const VectorXd& start, const MatrixXd& inverse_hessian,
                  const BfgsOptions& options) {
    std::vector<std::pair<VectorXd, VectorXd>> visited;  // the last point tried need not be the one kept
    const Objective objective = [&](const VectorXd& x, Evaluation* out) {
      const bool defined = likelihood->evaluate(x, out);
      if (defined) visited.emplace_back(x, likelihood->signal_variance());
      return defined;
    };
    Optimum found{minimise(objective, start, inverse_hessian, options), {}};
    if (likelihood->size() == all()) result_.evaluations += found.evaluations;
    for (const auto& [x, signal_variance] : visited) {
      if (found.defined && x == found.x) found.signal_variance = signal_variance;
    }
    return found;
  }

  // The different optima of the small subset, best first, at most kCarried.
  std::vector<Optimum> from_many_starts() {
    ProfiledLikelihood small = likelihood(std::min(all(), kStartPoints), 0, data_.y.cols());
    const Index count = box_.low.size();
    std::vector<Optimum> found;
    for (int s = 0; s < std::max(1, options_.starts) && !result_.given_up; ++s) {
      VectorXd start(count + 1);
      for (Index k = 0; k < count; ++k) start[k] = random_.uniform(box_.low[k], box_.high[k]);
      start[count] = random_.uniform(std::log(1e-4), std::log(1.0));
      const double curvature = 0.02 * static_cast<double>(small.size());
      Optimum end = improve(&small, start, MatrixXd::Identity(count + 1, count + 1) / curvature, {});
      if (end.defined) found.push_back(std::move(end));
      report(0.3 * (s + 1) / options_.starts);
    }
    std::stable_sort(found.begin(), found.end(), [](const Optimum& a, const Optimum& b) { return a.value < b.value; });
    std::vector<Optimum> different;
    for (Optimum& end : found) {
      if (end.value < found.front().value + kSameOptimum) ++result_.starts_at_best;
      const bool known = !different.empty() && end.value - different.back().value < kSameOptimum;
      if (!known && static_cast<int>(different.size()) < kCarried) different.push_back(end);
    }
    return different;
  }

  // By likelihood; one that predicts left-out points clearly worse than another has won by luck and is passed over.
  Optimum best_when_carried(std::vector<Optimum> candidates) {
    ProfiledLikelihood medium = likelihood(std::min(all(), kCarryPoints), 0, data_.y.cols());
    std::vector<double> leave_one_out;
    for (Optimum& candidate : candidates) {
      const double grown = static_cast<double>(std::min(all(), kStartPoints)) / static_cast<double>(medium.size());
      Optimum carried =
          improve(&medium, candidate.x, grown * candidate.inverse_hessian, {.max_evaluations = 20, .tolerance = 0.02});
      if (carried.defined) candidate = std::move(carried);
      Evaluation unused;
      leave_one_out.push_back(medium.evaluate(candidate.x, &unused) ? medium.leave_one_out_rms() : HUGE_VAL);
    }
    const double least = *std::min_element(leave_one_out.begin(), leave_one_out.end());
    std::size_t best = candidates.size();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (leave_one_out[i] > kWorseLeaveOneOut * least) continue;
      if (best == candidates.size() || candidates[i].value < candidates[best].value) best = i;
    }
    report(0.4);
    return candidates[best < candidates.size() ? best : 0];
  }

  // Output d alone, from the shared optimum, over growing subsets.
  void refine(Index d, const Optimum& shared) {
    const Index share = static_cast<Index>(kCarryShare * static_cast<double>(all()));
    const Index sizes[] = {std::min(all(), kCarryPoints), std::max(share, kCarryPoints), all()};
    const BfgsOptions limits[] = {{.max_evaluations = 30, .tolerance = 0.02},
                                  {.max_evaluations = 10, .tolerance = 0.05},
                                  {.max_evaluations = 3, .tolerance = 0.3}};
    const auto outputs = static_cast<double>(data_.y.cols());
    Optimum now = shared;
    now.inverse_hessian *= outputs;
    Index previous = sizes[0];
    now.signal_variance = shared.signal_variance.segment(d, 1);
    for (int stage = 0; stage < 3 && !result_.given_up; ++stage) {
      if (stage > 0 && std::min(sizes[stage], all()) == previous) continue;
      ProfiledLikelihood part = likelihood(std::min(sizes[stage], all()), d, 1);
      const double grown = static_cast<double>(previous) / static_cast<double>(part.size());
      Optimum found = improve(&part, now.x, grown * now.inverse_hessian, limits[stage]);
      previous = part.size();
      if (found.defined) now = std::move(found);
      report(0.4 + 0.6 * (static_cast<double>(d) + stage / 3.0) / outputs);
    }
    report(0.4 + 0.6 * static_cast<double>(d + 1) / outputs);
    const Index count = now.x.size() - 1;
    const double log_signal = 0.5 * std::log(now.signal_variance[0]);
    result_.outputs.push_back({now.x.head(count), log_signal, log_signal + 0.5 * now.x[count]});
  }

  std::shared_ptr<const Kernel> kernel_;
  const GpData& data_;
  const SearchOptions& options_;
  Random random_;
  SearchBox box_;
  std::vector<Index> order_;
  GpPrior prior_;
  SearchResult result_;
};

}  // namespace

std::optional<SearchResult> search_hyperparameters(const std::shared_ptr<const Kernel>& kernel, const GpData& data,
                                                   double metrology_stddev, const SearchOptions& options) {
  return Search(kernel, data, metrology_stddev, options).run();
}

}  // namespace trammel
