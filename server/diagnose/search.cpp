#include "server/diagnose/search.h"

#include <algorithm>

#include "server/diagnose/effect.h"
#include "server/diagnose/folds.h"
#include "server/diagnose/naming.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 40;         // forward and backward
constexpr double kMostOutliers = 0.1;  // of the poses
constexpr double kContender = 0.3;     // of the best score, to be among those that folds choose from
constexpr double kStepMargin = 5;      // nat
constexpr int kPathLength = 3;         // named causes that together may beat one anonymous function

Error given_up() { return {ErrorCode::kBusy, "diagnosis given up on request"}; }

std::vector<Parameter> priors_of(const CalibrationResult& calibration) {
  std::vector<Parameter> priors;
  for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  return priors;
}

class Search {
 public:
  Search(std::shared_ptr<const Cell> cell, const DiagnoseOptions& options)
      : cell_(std::move(cell)), options_(options) {}

  Status start(const std::vector<std::string>& sources, const MeasurementBatch& batch) {
    result_.all = result_.batch = batch;
    result_.sources = sources;
    if (const Status calibrated = calibrate_now(); !calibrated) return calibrated;
    result_.before = result_.model;
    result_.before_priors = result_.priors;
    return {};
  }

  /// Accepts one more; false where nothing passes.
  Result<bool> step() {
    const LinearProblem problem(result_.model, result_.batch, result_.priors,
                                candidate_sources(*cell_, result_.batch, nullptr));
    const std::vector<FamilyPtr> families = make_families(problem);
    const MatrixXd columns = background_columns(problem, result_.unnamed);
    const Background background(columns);
    if (chance_.null_score.size() == 0) renew_chance(families, background);
    Scan seen = scan(families, {background}, problem.residual(), chance_);
    const auto open = [&](std::size_t f) { return !is_closed(*families[f], seen.best[f]); };
    auto best = seen.strongest(open);
    if (best && is_close(seen.score[*best]) && renewed_for_ != result_.sources) {
      renew_chance(families, background);
      seen = scan(families, {background}, problem.residual(), chance_);
      best = seen.strongest(open);
    }
    if (!best || seen.score[*best] < chance_.limit) return false;
    auto named = seen.strongest([&](std::size_t f) { return open(f) && families[f]->named(); });
    if (named) named = whole_instead_of_step(families, seen, *named, open);
    if (!families[*best]->named()) {
      const bool path = named && named_path_score(families, columns, problem.residual(), open) >= seen.score[*best];
      if (!path) return take_unnamed(problem, *families[*best], seen, *best);
    }
    return take_named(problem, families, background, columns, seen, *named, open);
  }

  /// Drops what does not pass any more beside all the rest.
  Result<bool> prune() {
    const LinearProblem problem(result_.model, result_.batch, result_.priors, {});
    const MatrixXd columns = background_columns(problem, result_.unnamed);
    for (std::size_t k = 0; k < result_.accepted.size(); ++k) {
      if (result_.accepted[k].source.empty()) continue;
      const double score = remaining_score(problem, columns, result_.accepted[k]);
      if (score >= chance_.limit) continue;
      closed_.push_back(result_.accepted[k].cause);
      std::erase(result_.sources, result_.accepted[k].source);
      result_.accepted.erase(result_.accepted.begin() + static_cast<std::ptrdiff_t>(k));
      if (const Status calibrated = calibrate_now(); !calibrated) return tl::make_unexpected(calibrated.error());
      return true;
    }
    return prune_unnamed(problem);
  }

  SearchResult take() {
    result_.chance = std::move(chance_);
    return std::move(result_);
  }

 private:
  Status calibrate_now() {
    const Result<CalibrationResult> calibration = calibrate(cell_, result_.sources, result_.batch, {});
    if (!calibration) return tl::make_unexpected(calibration.error());
    result_.model = calibration->model;
    result_.priors = priors_of(*calibration);
    return {};
  }

  void renew_chance(const std::vector<FamilyPtr>& families, const Background& background) {
    chance_ = chance_of(families, background, options_.draws, options_.seed);
    renewed_for_ = result_.sources;
  }
  /// So near to the line that it must be known for the present background.
  bool is_close(double score) const { return score > 0.6 * chance_.limit && score < 1.6 * chance_.limit; }

  bool is_closed(const Family& family, const Best& best) const {
    const Cause cause = family.cause(best);
    return std::any_of(closed_.begin(), closed_.end(), [&](const Cause& one) {
      return one.cause == cause.cause && one.joint == cause.joint && one.parameter == cause.parameter &&
             one.pose_id == cause.pose_id && (!one.order || !cause.order || std::abs(*one.order - *cause.order) < 0.5);
    });
  }

  /// A step that a cause acting from the first pose on explains nearly as well is that cause.
  static std::size_t whole_instead_of_step(const std::vector<FamilyPtr>& families, const Scan& seen, std::size_t step,
                                           const std::function<bool(std::size_t)>& open) {
    const auto whole = seen.strongest([&](std::size_t f) {
      return open(f) && families[f]->named() &&
             is_whole_of(families[f]->cause(seen.best[f]), families[step]->cause(seen.best[step]));
    });
    return whole && seen.score[*whole] > seen.score[step] - kStepMargin ? *whole : step;
  }

  /// nat: what the best few named causes, taken one after the other, explain together.
  double named_path_score(const std::vector<FamilyPtr>& families, MatrixXd columns, const VectorXd& data,
                          const std::function<bool(std::size_t)>& open) const {
    double total = 0;
    for (int k = 0; k < kPathLength; ++k) {
      const Background background(columns);
      const MatrixXd projected = background.project(data);
      double highest = 0;
      MatrixXd chosen;
      for (std::size_t f = 0; f < families.size(); ++f) {
        if (!families[f]->named() || !open(f)) continue;
        const Best best = families[f]->scan({background}, projected).front();
        const double score = best.evidence - chance_.penalty_of(*families[f]);
        if (score <= highest) continue;
        highest = score;
        chosen = families[f]->columns(best);
      }
      if (highest < chance_.limit) break;
      total += highest;
      columns.conservativeResize(Eigen::NoChange, columns.cols() + chosen.cols());
      columns.rightCols(chosen.cols()) = chosen;
    }
    return total;
  }

  Result<bool> take_unnamed(const LinearProblem& problem, const Family& family, const Scan& seen, std::size_t place) {
    result_.unnamed.push_back({family.depends_on(),
                               problem.weight().cwiseInverse().asDiagonal() * family.columns(seen.best[place]),
                               seen.score[place], chance_.p_value(seen.score[place])});
    return true;
  }

  Result<bool> take_named(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                          const Background& background, const MatrixXd& columns, const Scan& seen, std::size_t place,
                          const std::function<bool(std::size_t)>& open) {
    const Family& family = *families[place];
    const Best& best = seen.best[place];
    if (family.predicts()) {
      // What scores little on all poses is not chosen in a fold that has most of them.
      const auto contends = [&](std::size_t f) {
        return families[f]->named() && families[f]->predicts() && open(f) &&
               seen.score[f] > kContender * seen.score[place];
      };
      const auto gain = Folds(problem).gain_of_selection(problem.residual(), columns, families, chance_, contends);
      if (!(gain.after < gain.before)) {
        closed_.push_back(family.cause(best));
        return true;
      }
    }
    Accepted one{family.cause(best),
                 family.source(best),
                 best,
                 chance_.penalty_of(family),
                 chance_.p_value(seen.score[place]),
                 1,
                 {},
                 {}};
    if (!family.predicts()) return take_outlier(problem, std::move(one));
    const Naming naming = name_or_doubt(problem, families, background, seen, chance_, place, options_.seed + 1);
    one.naming_frequency = naming.frequency;
    one.could_also_be = naming.could_also_be;
    const std::vector<std::string> sources = result_.sources;
    result_.sources.push_back(one.source);
    if (const Status calibrated = calibrate_now(); !calibrated) {
      // The nonlinear fit does not want it: what cannot be fitted is not named.
      result_.sources = sources;
      closed_.push_back(one.cause);
      if (const Status again = calibrate_now(); !again) return tl::make_unexpected(again.error());
      return true;
    }
    result_.accepted.push_back(std::move(one));
    return true;
  }

  Result<bool> take_outlier(const LinearProblem& problem, Accepted one) {
    const auto pose = static_cast<std::size_t>(one.best.at);
    const auto outliers = std::count_if(result_.accepted.begin(), result_.accepted.end(),
                                        [](const Accepted& a) { return a.source.empty(); });
    if (static_cast<double>(outliers) >= kMostOutliers * static_cast<double>(result_.all.measurements.size())) {
      closed_.push_back(one.cause);
      return true;
    }
    const Measurement& m = result_.batch.measurements[pose];
    const Index row = problem.first_row(static_cast<Index>(pose));
    const Index count = problem.row_count(static_cast<Index>(pose));
    one.pose = {m.pose_id, m.row, problem.positions(problem.residual()).col(static_cast<Index>(pose)).norm(),
                "single pose, cause not separable: repeat it and its neighbours"};
    result_.batch.measurements.erase(result_.batch.measurements.begin() + static_cast<std::ptrdiff_t>(pose));
    for (Unnamed& unnamed : result_.unnamed) {
      MatrixXd kept(unnamed.columns.rows() - count, unnamed.columns.cols());
      kept << unnamed.columns.topRows(row), unnamed.columns.bottomRows(unnamed.columns.rows() - row - count);
      unnamed.columns = std::move(kept);
    }
    result_.accepted.push_back(std::move(one));
    if (const Status calibrated = calibrate_now(); !calibrated) return tl::make_unexpected(calibrated.error());
    return true;
  }

  double remaining_score(const LinearProblem& problem, const MatrixXd& columns, const Accepted& one) const {
    const std::string name = name_in_model(problem.model(), one.source);
    std::vector<Index> own, others;
    Index next = 0;
    for (const ErrorSourcePtr& source : problem.model().sources) {
      for (std::size_t k = 0; k < source->parameters().size(); ++k, ++next)
        (source->name() == name ? own : others).push_back(next);
    }
    for (; next < columns.cols(); ++next) others.push_back(next);
    const Background rest(columns(Eigen::all, others));
    const VectorXd effect = effect_of_source(problem, name);
    const VectorXd projected = rest.project(problem.residual() + effect);
    const MatrixXd C = columns(Eigen::all, own);
    const MatrixXd information = C.transpose() * rest.project(C) + MatrixXd::Identity(C.cols(), C.cols());
    const VectorXd right = C.transpose() * projected;
    const double strength = right.dot(information.llt().solve(right));
    return log_evidence(strength, std::min<double>(one.best.freedom, static_cast<double>(own.size()))) - one.penalty;
  }

  Result<bool> prune_unnamed(const LinearProblem& problem) {
    for (std::size_t k = 0; k < result_.unnamed.size(); ++k) {
      std::vector<Unnamed> others = result_.unnamed;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const Background rest(background_columns(problem, others));
      const MatrixXd C = problem.weight().asDiagonal() * result_.unnamed[k].columns;
      const MatrixXd information = C.transpose() * rest.project(C) + MatrixXd::Identity(C.cols(), C.cols());
      const VectorXd right = C.transpose() * rest.project(problem.residual());
      const Eigen::LLT<MatrixXd> factor(information);
      const double log_det = 2 * MatrixXd(factor.matrixL()).diagonal().array().log().sum();
      const double evidence = 0.5 * (right.dot(factor.solve(right)) - log_det);
      if (evidence >= chance_.limit) continue;
      result_.unnamed = std::move(others);
      return true;
    }
    return false;
  }

  std::shared_ptr<const Cell> cell_;
  const DiagnoseOptions& options_;
  SearchResult result_;
  Chance chance_;
  std::vector<std::string> renewed_for_;  // the sources that chance_ was found with
  std::vector<Cause> closed_;             // were tried and did not hold
};

}  // namespace

MatrixXd background_columns(const LinearProblem& problem, const std::vector<Unnamed>& unnamed) {
  Index count = problem.nuisance().cols();
  for (const Unnamed& one : unnamed) count += one.columns.cols();
  MatrixXd columns(problem.rows(), count);
  columns.leftCols(problem.nuisance().cols()) = problem.nuisance();
  Index next = problem.nuisance().cols();
  for (const Unnamed& one : unnamed) {
    columns.middleCols(next, one.columns.cols()) = problem.weight().asDiagonal() * one.columns;
    next += one.columns.cols();
  }
  return columns;
}

Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
                                   const MeasurementBatch& batch, const DiagnoseOptions& options) {
  Search search(cell, options);
  if (const Status started = search.start(sources, batch); !started) return tl::make_unexpected(started.error());
  bool changed = true;
  for (int k = 0; k < kMostSteps && changed; ++k) {
    if (options.progress && !options.progress("looking for causes", 0.6 * k / kMostSteps))
      return tl::make_unexpected(given_up());
    Result<bool> more = search.step();
    if (more && !*more) more = search.prune();
    if (!more) return tl::make_unexpected(more.error());
    changed = *more;
  }
  return search.take();
}

}  // namespace trammel
