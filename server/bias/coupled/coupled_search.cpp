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
constexpr std::size_t kRivals = 2;      // optima of the first searches that go on
constexpr double kSmallestLog = -21.0;  // of σ_f, m: 1 nm, for an output that is constantly zero

CoupledData subset(const CoupledData& data, const std::vector<Index>& order, Index count) {
  const std::vector<Index> rows(order.begin(), order.begin() + count);
  CoupledData part{data.q(rows, Eigen::all), data.y(rows, Eigen::all), data.noise_shape(rows), {}};
  for (const MatrixXd& columns : data.columns) part.columns.emplace_back(columns(rows, Eigen::all));
  return part;
}

// One search in progress.
class CoupledSearch {
 public:
  CoupledSearch(std::shared_ptr<const Kernel> kernel, const CoupledTask& task,
                const CoupledTask& coarse, const VectorXd& metrology_stddev, bool shared_scales,
                const SearchOptions& options)
      : kernel_(std::move(kernel)),
        task_(task),
        coarse_(coarse),
        shared_scales_(shared_scales),
        options_(options),
        random_(options.seed),
        box_(kernel_->search_box(task.data.q)),
        order_(shuffled_rows(task.data.q.rows(), &random_)) {
    prior_.noise_stddev = metrology_stddev;
    prior_.parameter_centre = 0.5 * (box_.low + box_.high);
    prior_.signal_centre =
        (task.data.y.colwise().squaredNorm() / static_cast<double>(task.data.q.rows()))
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
      last_stage_ = true;
      const Place from = unknown_curvature(*last, all(), shared_scales_);
      result_.found =
          improved(from, all(), shared_scales_, {.max_evaluations = 10, .tolerance = 0.3}, 1.0).at;
      return result_;
    }
    std::vector<Place> rivals = from_several_starts();
    if (result_.given_up) return result_;
    if (rivals.empty()) return std::nullopt;
    Place best = best_of(std::move(rivals));
    if (all() > kMediumPoints)
      best = improved(best, all(), true, {.max_evaluations = 12, .tolerance = 0.1}, 0.75);
    last_stage_ = true;
    if (!shared_scales_)
      best = improved(of_each_output(best), all(), false, {.max_evaluations = 14, .tolerance = 0.1},
                      0.95);
    report(1.0);
    result_.found = best.at;
    return result_;
  }

 private:
  Index all() const { return task_.data.q.rows(); }

  void report(double share) {
    if (options_.progress && !options_.progress(share)) result_.given_up = true;
  }

  CoupledLikelihood likelihood(Index count, bool shared) {
    prior_.shared_scales = shared;
    const CoupledTask& task = last_stage_ ? task_ : coarse_;
    return {kernel_, task.blocks, subset(task.data, order_, count), prior_};
  }

  VectorXd random_start() {
    const Index outputs = task_.data.y.cols();
    CoupledHyperparameters start;
    VectorXd scales(box_.low.size());
    for (Index k = 0; k < scales.size(); ++k)
      scales[k] = random_.uniform(box_.low[k], box_.high[k]);
    const double signal = random_.uniform(-3.0, 1.0);
    for (Index d = 0; d < outputs; ++d)
      start.outputs.push_back(
          {scales, prior_.signal_centre[d] + signal, std::log(1.5 * prior_.noise_stddev[d])});
    start.blocks = task_.blocks.start();
    return likelihood(1, true).pack(start);
  }

  /// The present point of a search, and the curvature there as far as it is known.
  struct Place {
    CoupledHyperparameters at;
    MatrixXd inverse_hessian;
    Index points = 0;  // the number of points of the search that found it
    double value = HUGE_VAL;
  };

  Place unknown_curvature(const CoupledHyperparameters& at, Index points, bool shared) {
    const Index size = likelihood(1, shared).pack(at).size();
    return {at, MatrixXd::Identity(size, size) / (0.05 * static_cast<double>(points)), points};
  }

  BfgsResult improve(const CoupledLikelihood& function, const Place& from,
                     const BfgsOptions& limits) {
    const Objective objective = [&](const VectorXd& x, ObjectiveValue* out) {
      return !result_.given_up && function.evaluate(x, out);
    };
    const double grown = static_cast<double>(from.points) / static_cast<double>(function.size());
    BfgsResult found =
        minimise(objective, function.pack(from.at), grown * from.inverse_hessian, limits);
    if (function.size() == all()) result_.evaluations += found.evaluations;
    return found;
  }

  // The best two that differ: on few points the second may stand before the first.
  std::vector<Place> from_several_starts() {
    const CoupledLikelihood small = likelihood(std::min(all(), kStartPoints), true);
    const int starts = std::clamp(options_.starts, 1, kMostStarts);
    std::vector<BfgsResult> ends;
    for (int s = 0; s < starts && !result_.given_up; ++s) {
      const Place start = unknown_curvature(small.unpack(random_start()), small.size(), true);
      BfgsResult end = improve(small, start, {.max_evaluations = 60, .tolerance = 0.02});
      if (end.defined) ends.push_back(std::move(end));
      report(0.3 * (s + 1) / starts);
    }
    std::stable_sort(ends.begin(), ends.end(),
                     [](const auto& a, const auto& b) { return a.value < b.value; });
    std::vector<Place> best;
    for (const BfgsResult& end : ends) {
      result_.starts_at_best += end.value < ends.front().value + kSameOptimum;
      if (best.size() < kRivals && (best.empty() || end.value > best.back().value + kSameOptimum))
        best.push_back({small.unpack(end.x), end.inverse_hessian, small.size(), end.value});
    }
    return best;
  }

  Place best_of(std::vector<Place> rivals) {
    const Index medium = std::min(all(), kMediumPoints);
    if (medium <= kStartPoints) return rivals.front();
    for (Place& rival : rivals)
      rival = improved(rival, medium, true, {.max_evaluations = 25, .tolerance = 0.1}, 0.5);
    return *std::min_element(rivals.begin(), rivals.end(),
                             [](const Place& a, const Place& b) { return a.value < b.value; });
  }

  // The kernels' part of the curvature is shared out among the outputs.
  static Place of_each_output(const Place& shared) {
    const auto outputs = static_cast<Index>(shared.at.outputs.size());
    const Index scales = shared.at.outputs.front().kernel.size();
    const Index rest = shared.inverse_hessian.rows() - scales;
    Place each = shared;
    each.inverse_hessian = MatrixXd::Zero(outputs * scales + rest, outputs * scales + rest);
    for (Index d = 0; d < outputs; ++d)
      each.inverse_hessian.block(d * scales, d * scales, scales, scales) =
          static_cast<double>(outputs) * shared.inverse_hessian.topLeftCorner(scales, scales);
    each.inverse_hessian.bottomRightCorner(rest, rest) =
        shared.inverse_hessian.bottomRightCorner(rest, rest);
    return each;
  }

  Place improved(const Place& from, Index count, bool shared, const BfgsOptions& limits,
                 double share_done) {
    if (result_.given_up) return from;
    const CoupledLikelihood function = likelihood(count, shared);
    const BfgsResult found = improve(function, from, limits);
    report(share_done);
    if (!found.defined) return from;
    return {function.unpack(found.x), found.inverse_hessian, count, found.value};
  }

  std::shared_ptr<const Kernel> kernel_;
  const CoupledTask& task_;
  const CoupledTask& coarse_;
  bool last_stage_ = false;
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
                                                  const CoupledTask& task,
                                                  const CoupledTask& coarse,
                                                  const VectorXd& metrology_stddev,
                                                  bool shared_scales, const SearchOptions& options,
                                                  const CoupledHyperparameters* last) {
  return CoupledSearch(kernel, task, coarse, metrology_stddev, shared_scales, options).run(last);
}

}  // namespace trammel
