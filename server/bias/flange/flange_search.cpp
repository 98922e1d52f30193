#include "server/bias/flange/flange_search.h"

#include <algorithm>
#include <cmath>

#include "server/numerics/seeded_random.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTypicalArm = 0.5;  // m: a typical distance from the tool to the parts that turn
                                     // the flange, between wrist and shoulder
constexpr Index kStartNumbers =
    600;  // joint vectors of the first searches: one likelihood takes 20 ms
constexpr Index kFewestStartPoints = 40;
constexpr double kSmallestLog = -21.0;  // of σ_f, m: 1 nm, for an output that is constantly zero

double mean_log_signal(const std::vector<GpHyperparameters>& outputs) {
  double mean_square = 0;
  for (const GpHyperparameters& output : outputs)
    mean_square += std::exp(2 * output.log_signal_stddev);
  return std::max(kSmallestLog, 0.5 * std::log(mean_square / static_cast<double>(outputs.size())));
}

class FlangeSearch {
 public:
  FlangeSearch(KernelPtr kernel, const FlangeViews& views, const MatrixXd& y,
               const CoupledHyperparameters& plain, double metrology_stddev,
               const SearchOptions& options)
      : kernel_(std::move(kernel)), views_(views), y_(y), options_(options), random_(options.seed) {
    const SearchBox box = kernel_->search_box(views.q);
    prior_.noise_stddev = metrology_stddev;
    prior_.parameter_centre = 0.5 * (box.low + box.high);
    prior_.rotation_centre = rotation_like(plain.outputs);
    prior_.signal_centre = mean_log_signal(plain.outputs);
    order_ = shuffled_rows(views.q.rows(), &random_);
  }

  std::optional<CoupledSearchResult> run(const CoupledHyperparameters& plain, bool again) {
    std::optional<Start> from = Start{plain, unknown_curvature(plain, all())};
    if (!again) from = from_few(plain);
    if (result_.given_up) return result_;
    if (!from) return std::nullopt;
    const FlangeLikelihood whole = likelihood(all());
    const BfgsResult found = improve(whole, *from, {.max_evaluations = 12, .tolerance = 0.1});
    report(1.0);
    if (!found.defined && !result_.given_up) return std::nullopt;
    if (found.defined) result_.found = whole.unpack(found.x);
    result_.evaluations += found.evaluations;
    return result_;
  }

 private:
  Index all() const { return views_.q.rows(); }

  void report(double share) {
    if (options_.progress && !options_.progress(share)) result_.given_up = true;
  }

  FlangeLikelihood likelihood(Index count) const {
    const FlangeViews part = some_of(views_, {order_.begin(), order_.begin() + count});
    return {kernel_, part, numbers_of(part, y_), prior_};
  }

  struct Start {
    CoupledHyperparameters at;
    MatrixXd inverse_hessian;
  };

  static MatrixXd unknown_curvature(const CoupledHyperparameters& at, Index count) {
    const Index size = 4 * at.outputs.front().kernel.size() + 5;
    return MatrixXd::Identity(size, size) / (0.15 * static_cast<double>(count));
  }

  BfgsResult improve(const FlangeLikelihood& function, const Start& from,
                     const BfgsOptions& limits) const {
    const Objective objective = [&](const VectorXd& x, ObjectiveValue* out) {
      return !result_.given_up && function.evaluate(x, out);
    };
    return minimise(objective, function.pack(from.at), from.inverse_hessian, limits);
  }

  // If rows of several levers are mistaken for rows of one, they have much noise. One start
  // therefore has the noise of the instrument.
  std::optional<Start> from_few(const CoupledHyperparameters& plain) {
    const Index count =
        std::clamp(kStartNumbers * all() / views_.size, std::min(all(), kFewestStartPoints), all());
    const FlangeLikelihood small = likelihood(count);
    std::optional<BfgsResult> best;
    for (const bool instrument : {false, true}) {
      Start start{plain, unknown_curvature(plain, count)};
      start.at.blocks = prior_.rotation_centre;
      if (instrument)
        start.at.outputs.front().log_noise_stddev = std::log(1.5 * prior_.noise_stddev);
      BfgsResult end = improve(small, start, {.max_evaluations = 60, .tolerance = 0.05});
      report(instrument ? 0.4 : 0.2);
      if (!end.defined) continue;
      ++result_.starts_at_best;
      if (!best || end.value < best->value) best = std::move(end);
    }
    if (!best) return std::nullopt;
    const double grown = static_cast<double>(count) / static_cast<double>(all());
    return Start{small.unpack(best->x), grown * best->inverse_hessian};
  }

  KernelPtr kernel_;
  const FlangeViews& views_;
  const MatrixXd& y_;
  const SearchOptions& options_;
  SeededRandom random_;
  FlangePrior prior_;
  std::vector<Index> order_;
  CoupledSearchResult result_;
};

}  // namespace

VectorXd rotation_like(const std::vector<GpHyperparameters>& position) {
  const Index count = position.front().kernel.size();
  VectorXd rotation = VectorXd::Zero(count + 1);
  for (const GpHyperparameters& output : position)
    rotation.head(count) += output.kernel / static_cast<double>(position.size());
  rotation[count] = mean_log_signal(position) - std::log(kTypicalArm);
  return rotation;
}

std::optional<CoupledSearchResult> search_flange(const KernelPtr& kernel, const FlangeViews& views,
                                                 const MatrixXd& y,
                                                 const CoupledHyperparameters& plain,
                                                 double metrology_stddev,
                                                 const SearchOptions& options, bool again) {
  return FlangeSearch(kernel, views, y, plain, metrology_stddev, options).run(plain, again);
}

}  // namespace trammel
