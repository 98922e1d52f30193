#include "server/bias/search/hyperparameter_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bias/search/optima.h"
#include "server/bias/search/starts.h"
#include "server/numerics/seeded_random.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Points of each stage. Cheap stages do most of the work, so that few evaluations on all points are
// enough.
constexpr double kStartShare =
    0.125;                           // of all points, for the first searches; kStartPoints at least
constexpr Index kCarryPoints = 300;  // for the first optima, which are then judged by leave-one-out
constexpr double kCarryShare = 0.45;  // of all points, for the stage before the last
constexpr Index kCurvaturePoints =
    1000;  // at most, for finite differences of the curvature: more points show the same
constexpr Index kMostSearched = 2500;  // more points would take longer than the last nats are worth
constexpr Index kFinerPoints =
    400;  // at least, to look for finer length scales: fewer cannot show them
constexpr Index kAroundPoints =
    2000;  // at most, for looking around: each try costs as much as a start
// The number of optima that are kept.
constexpr std::size_t kCarried = 5;  // from the first searches: each is carried at full cost
constexpr std::size_t kRivals = 3;   // of one output before the last stage
// In natural logarithms.
constexpr double kLeastLogRatio = -14.0;  // of η: with less noise a start is badly conditioned
constexpr double kUnexplainedNoise =
    1.4;  // four times the instrument's noise: something is left to explain
constexpr double kLessNoise =
    1.4;  // of the variance: half the noise, as finer length scales may explain the rest
constexpr double kFineLogRatio = -4.0;  // of η: noise a seventh of the signal
constexpr double kBeyondBox = 1.0;      // length scales finer or longer than those of any start
constexpr double kWeak = 0.5;  // below the box: longer length scales have no strong influence
constexpr double kWideSpread =
    10.0;  // of the prior on kernel parameters, which on all points must not matter
// Others.
constexpr double kGain = 0.5;  // nat: an optimum worth moving to
constexpr double kWorseLeaveOneOut =
    1.1;  // over the least error: a likelier optimum that predicts worse won by luck
constexpr double kRefined = 0.4;  // share of one output's progress before looking around

GpData subset(const GpData& data, const std::vector<Index>& order, Index count, Index first_output,
              Index outputs) {
  GpData part{MatrixXd(count, data.q.cols()), MatrixXd(count, outputs), VectorXd(count)};
  for (Index i = 0; i < count; ++i) {
    const Index row = order[static_cast<std::size_t>(i)];
    part.q.row(i) = data.q.row(row);
    part.y.row(i) = data.y.row(row).segment(first_output, outputs);
    part.noise_shape[i] = data.noise_shape[row];
  }
  return part;
}

// One search in progress.
class Search {
 public:
  Search(std::shared_ptr<const Kernel> kernel, const GpData& data, double metrology_stddev,
         const SearchOptions& options)
      : kernel_(std::move(kernel)),
        data_(data),
        options_(options),
        random_(options.seed),
        box_(kernel_->search_box(data.q)) {
    order_ = shuffled_rows(data.q.rows(), &random_);
    prior_.noise_stddev = metrology_stddev;
    prior_.parameter_centre = 0.5 * (box_.low + box_.high);
  }

  std::optional<SearchResult> run() {
    if (!options_.last.empty()) {
      for (Index d = 0; d < data_.y.cols() && !result_.given_up; ++d) refit(d);
      return result_;
    }
    std::vector<Optimum> shared = from_many_starts();
    if (result_.given_up) return result_;
    if (shared.empty()) return std::nullopt;
    shared = carried(std::move(shared));
    for (Index d = 0; d < data_.y.cols() && !result_.given_up; ++d) refine(d, shared);
    return result_;
  }

 private:
  // On few points a fine influence of a joint looks like noise, and no start finds it. If more
  // noise is left than the instrument has, one search on more points tries shorter length scales.
  void look_finer(ProfiledLikelihood* likelihood, std::vector<Optimum>* rivals) {
    const Optimum& best = rivals->front();
    const double unexplained = unexplained_noise(best);
    const bool tried = std::any_of(rivals->begin(), rivals->end(), [&](const Optimum& rival) {
      return other_kind(rival, best) && log_noise(rival) < log_noise(best);
    });
    if (likelihood->size() < kFinerPoints || unexplained < kUnexplainedNoise || tried) return;
    VectorXd start = best.x;
    const Index count = box_.low.size();
    start.head(count) = start.head(count).cwiseMin((box_.low.array() + std::log(2.0)).matrix());
    start[count] = std::max(start[count] - unexplained, kLeastLogRatio);
    Optimum finer = counted(searched(likelihood, start, {.max_evaluations = 40, .tolerance = 0.02}),
                            *likelihood);
    if (finer.defined) rivals->push_back(std::move(finer));
  }

  // In logs, above the instrument's.
  double unexplained_noise(const Optimum& optimum) const {
    return log_noise(optimum) - std::log(prior_.noise_stddev);
  }

  // A function finer than the spacing of few points shows on many points only, and joints of weak
  // influence hide each other. So if much noise is left, this tries fine length scales for all
  // joints at once. Then it tries to remove all weak joints at once, and to give a fine scale to
  // each joint without influence, until neither gains.
  Optimum looked_around(Index d, const Optimum& from, double share_before, double share_after) {
    ProfiledLikelihood many = likelihood(std::min(all(), kAroundPoints), d, 1);
    Optimum best = counted(searched(&many, from.x, {.max_evaluations = 1}), many);
    double left = share_after - share_before;  // the number of tries is unknown in advance, so each
                                               // takes a tenth of the rest
    const auto worthwhile = [&] {
      return !result_.given_up && unexplained_noise(best) >= kUnexplainedNoise;
    };
    const auto gains = [&](const VectorXd& kernel, double log_ratio) {
      VectorXd start(kernel.size() + 1);
      start << kernel, std::max(log_ratio, kLeastLogRatio);
      Optimum end =
          counted(searched(&many, start, {.max_evaluations = 25, .tolerance = 1.0}), many);
      report(share_after - (left *= 0.9));
      const bool better = end.defined && end.value < best.value - kGain;
      if (better) best = std::move(end);
      return better;
    };
    if (!best.defined || !worthwhile()) return from;

    const Index count = box_.low.size();
    const VectorXd fine = box_.low.array() - kBeyondBox;
    const VectorXd idle = box_.high.array() + kBeyondBox;
    gains(fine, std::min(best.x[count] - kLessNoise, kFineLogRatio));
    for (bool gained = true; gained && worthwhile();) {
      const VectorXd known = best.x.head(count);
      const auto weak = known.array() > box_.low.array() - kWeak;
      gained = gains(weak.select(known.cwiseMax(idle), known), best.x[count]);
      for (Index k = 0; k < count && worthwhile(); ++k) {
        if (best.x[k] < box_.high[k]) continue;
        VectorXd awake = best.x.head(count);
        awake[k] = fine[k];
        gained = gains(awake, best.x[count] - kLessNoise) || gained;
      }
    }
    best.x.head(count) = best.x.head(count).cwiseMin(idle);  // farther out the likelihood is flat
    const Optimum end = polished(d, best.x);
    return end.defined && end.value < from.value ? end : from;
  }

  // On all points, from a start near the optimum.
  Optimum polished(Index d, const VectorXd& start) {
    ProfiledLikelihood middle = likelihood(std::min(all(), kCurvaturePoints), d, 1);
    ProfiledLikelihood whole = likelihood(all(), d, 1);
    Optimum now = searched(&middle, start, {.max_evaluations = 1});
    if (!now.defined) return now;
    use_curvature(&middle, 1.0 / std::pow(prior_.parameter_spread, 2), &now);
    const double grown = static_cast<double>(middle.size()) / static_cast<double>(whole.size());
    return counted(improved(&whole, start, grown * now.inverse_hessian,
                            {.max_evaluations = 12, .tolerance = 0.02}),
                   whole);
  }

  Optimum counted(Optimum found, const ProfiledLikelihood& likelihood) {
    if (likelihood.size() == all()) result_.evaluations += found.evaluations;
    return found;
  }

  Index start_points() const {
    const Index share = static_cast<Index>(kStartShare * static_cast<double>(all()));
    return std::min(all(), std::clamp(share, kStartPoints, kCarryPoints));
  }

  Index all() const { return std::min(data_.q.rows(), kMostSearched); }

  // On few points the prior leads. On all points it must not cost the likelihood 0.1 nat.
  ProfiledLikelihood likelihood(Index count, Index first_output, Index outputs) const {
    GpPrior prior = prior_;
    if (count == all()) prior.parameter_spread = kWideSpread;
    return {kernel_, subset(data_, order_, count, first_output, outputs), prior};
  }

  void report(double share) {
    if (options_.progress && !options_.progress(share)) result_.given_up = true;
  }

  // The different optima of the small subset, best first, at most kCarried.
  std::vector<Optimum> from_many_starts() {
    ProfiledLikelihood small = likelihood(start_points(), 0, data_.y.cols());
    const Index count = box_.low.size();
    const double least_log_ratio = std::max(
        std::log(std::pow(prior_.noise_stddev, 2) / data_.y.cwiseAbs2().mean()), kLeastLogRatio);
    std::vector<Optimum> found;
    double best = HUGE_VAL;
    for (int s = 0; s < std::max(1, options_.starts) && !result_.given_up; ++s) {
      VectorXd start(count + 1);
      for (Index k = 0; k < count; ++k) start[k] = random_.uniform(box_.low[k], box_.high[k]);
      start[count] = random_.uniform(std::min(least_log_ratio, std::log(1e-4)), std::log(1.0));
      Optimum end = counted(searched(&small, start, {.tolerance = 0.01}), small);
      if (end.defined) found.push_back(std::move(end));
      report(0.3 * (s + 1) / options_.starts);
    }
    for (const Optimum& end : found) best = std::min(best, end.value);
    for (const Optimum& end : found)
      result_.starts_at_best += end.value < best + kSameOptimum ? 1 : 0;
    return different(std::move(found), kCarried);
  }

  // The optima by likelihood, without those that predict left-out points clearly worse than
  // another.
  std::vector<Optimum> carried(std::vector<Optimum> candidates) {
    ProfiledLikelihood medium = likelihood(std::min(all(), kCarryPoints), 0, data_.y.cols());
    std::vector<double> leave_one_out;
    for (Optimum& candidate : candidates) {
      const double grown = static_cast<double>(start_points()) / static_cast<double>(medium.size());
      Optimum better = counted(improved(&medium, candidate.x, grown * candidate.inverse_hessian,
                                        {.max_evaluations = 20, .tolerance = 0.02}),
                               medium);
      if (better.defined) candidate = std::move(better);
      ObjectiveValue unused;
      leave_one_out.push_back(medium.evaluate(candidate.x, &unused) ? medium.leave_one_out_rms()
                                                                    : HUGE_VAL);
    }
    const double least = *std::min_element(leave_one_out.begin(), leave_one_out.end());
    std::vector<Optimum> honest;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (leave_one_out[i] <= kWorseLeaveOneOut * least) honest.push_back(std::move(candidates[i]));
    }
    report(0.4);
    return different(std::move(honest), kCarried);
  }

  // Continues from the end of the last fit; keeps that end if the likelihood is undefined there.
  void refit(Index d) {
    const GpHyperparameters& last = options_.last[static_cast<std::size_t>(d)];
    VectorXd start(last.kernel.size() + 1);
    start << last.kernel, 2.0 * (last.log_noise_stddev - last.log_signal_stddev);
    const Optimum now = polished(d, start);
    result_.outputs.push_back(now.defined ? hyperparameters_at(now) : last);
    report(static_cast<double>(d + 1) / static_cast<double>(data_.y.cols()));
  }

  static GpHyperparameters hyperparameters_at(const Optimum& optimum) {
    const Index count = optimum.x.size() - 1;
    const double log_signal = 0.5 * std::log(optimum.signal_variance[0]);
    return {optimum.x.head(count), log_signal, log_signal + 0.5 * optimum.x[count]};
  }

  struct Stage {
    Index points;
    BfgsOptions options;
    std::size_t rivals;  // carried on to the next stage
    bool curvature;      // differenced at the end, for the next stage
  };

  std::vector<Stage> stages() const {
    const Index share = static_cast<Index>(kCarryShare * static_cast<double>(all()));
    const Index middle = std::clamp(share, kCarryPoints, kCurvaturePoints);
    std::vector<Stage> stages = {
        {std::min(all(), kCarryPoints),
         {.max_evaluations = 40, .tolerance = all() > kCarryPoints ? 0.02 : 0.002},
         kCarried,
         false}};
    if (all() > kCarryPoints) {
      const std::size_t rivals = all() < kMostSearched ? kRivals : 1;
      stages.push_back(
          {std::min(all(), middle), {.max_evaluations = 15, .tolerance = 0.02}, rivals, true});
    }
    if (all() > middle)
      stages.push_back({all(),
                        {.max_evaluations = all() < kMostSearched ? 12 : 4, .tolerance = 0.02},
                        1,
                        false});
    return stages;
  }

  // Output d alone, from the shared optima, over growing subsets. All optima that may still win are
  // carried on, since the last nats decide between them.
  void refine(Index d, const std::vector<Optimum>& shared) {
    const auto outputs = static_cast<double>(data_.y.cols());
    std::vector<Optimum> rivals = shared;
    for (Optimum& rival : rivals) {
      rival.inverse_hessian *= outputs;
      rival.signal_variance = rival.signal_variance.segment(d, 1).eval();
    }
    Index previous = std::min(all(), kCarryPoints);
    const std::vector<Stage> all_stages = stages();
    for (std::size_t s = 0; s < all_stages.size() && !result_.given_up; ++s) {
      const Stage& stage = all_stages[s];
      ProfiledLikelihood part = likelihood(stage.points, d, 1);
      const double grown = static_cast<double>(previous) / static_cast<double>(stage.points);
      previous = stage.points;
      for (Optimum& rival : rivals) {
        Optimum found =
            counted(improved(&part, rival.x, grown * rival.inverse_hessian, stage.options), part);
        if (found.defined) rival = std::move(found);
      }
      if (stage.points <= kCurvaturePoints) look_finer(&part, &rivals);
      rivals = different(std::move(rivals), stage.rivals);
      if (stage.curvature) {
        for (Optimum& rival : rivals)
          use_curvature(&part, 1.0 / std::pow(prior_.parameter_spread, 2), &rival);
      }
      report(0.4 + 0.6 *
                       (static_cast<double>(d) + kRefined * static_cast<double>(s + 1) /
                                                     static_cast<double>(all_stages.size())) /
                       outputs);
    }
    Optimum best = rivals.front();
    if (all() > kCurvaturePoints && !result_.given_up) {
      const auto share = [&](double of_output) {
        return 0.4 + 0.6 * (static_cast<double>(d) + of_output) / outputs;
      };
      best = looked_around(d, best, share(kRefined), share(1));
    }
    report(0.4 + 0.6 * static_cast<double>(d + 1) / outputs);
    result_.outputs.push_back(hyperparameters_at(best));
  }

  std::shared_ptr<const Kernel> kernel_;
  const GpData& data_;
  const SearchOptions& options_;
  SeededRandom random_;
  SearchBox box_;
  std::vector<Index> order_;
  GpPrior prior_;
  SearchResult result_;
};

}  // namespace

std::optional<SearchResult> search_hyperparameters(const std::shared_ptr<const Kernel>& kernel,
                                                   const GpData& data, double metrology_stddev,
                                                   const SearchOptions& options) {
  return Search(kernel, data, metrology_stddev, options).run();
}

}  // namespace trammel
