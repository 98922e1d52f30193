#include "server/diagnose/search/search.h"

#include <algorithm>

#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/search/naming.h"

namespace trammel {

namespace {

using causes::SearchFamily;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 40;          // forward and backward
constexpr double kMostOutliers = 0.1;   // of the poses
constexpr double kBeyondDoubt = 6;      // times the line: there no fold can disagree
constexpr double kTellingColumn = 0.1;  // sigmas over all rows, that a function's share may at most be left out with
constexpr double kUnnamedMargin = 2;    // nat, by which no name must be better than a name
constexpr double kContender = 0.3;      // of the best score, to be among those that folds choose from
constexpr double kSimplerMargin = 5;    // nat
constexpr int kFewestHarmonics = 4;
constexpr int kPathLength = 3;  // named causes that together may beat one anonymous function

Failure given_up() { return failure(ErrorCode::kBusy, "diagnosis given up on request"); }

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
    const Result<CalibrationResult> calibration = calibrate(cell_, sources, batch, {});
    if (!calibration) return tl::make_unexpected(calibration.error());
    sources_ = sources;
    result_.before = {calibration->model, priors_of(*calibration)};
    result_.after = result_.before;
    return {};
  }

  /// Accepts one more; false where nothing passes.
  Result<bool> step() {
    const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors,
                                candidate_sources(*cell_, result_.batch, nullptr));
    const std::vector<FamilyPtr> families = make_families(problem);
    const MatrixXd columns = background_columns(problem, result_.unnamed);
    const Background background(columns);
    if (chance_.null_score.size() == 0) renew_chance(families, background);
    Scan seen = scan(families, {background}, problem.residual(), chance_);
    const auto open = [&](std::size_t f) { return !is_closed(*families[f], seen.best[f]); };
    auto best = seen.strongest(open);
    if (best && is_close(seen.score[*best]) && renewed_for_ != result_.accepted.size() + result_.unnamed.size()) {
      renew_chance(families, background);
      seen = scan(families, {background}, problem.residual(), chance_);
      best = seen.strongest(open);
    }
    if (!best || seen.score[*best] < chance_.limit) return false;
    auto named = seen.strongest([&](std::size_t f) { return open(f) && families[f]->named(); });
    if (named) named = simplest(families, seen, *named, open);
    const bool unnamed_wins =
        !families[*best]->named() && (!named || seen.score[*best] > seen.score[*named] + kUnnamedMargin);
    if (unnamed_wins) {
      const bool path = named && named_path_score(families, columns, problem.residual(), open) >= seen.score[*best];
      if (!path) return take_unnamed(problem, *families[*best], seen, *best);
    }
    return take_named(problem, families, background, columns, seen, *named, open);
  }

  /// Drops what does not pass any more beside all the rest.
  Result<bool> prune() {
    const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors, {});
    const Background all(background_columns(problem, result_.unnamed));
    const VectorXd change = all.estimate(problem.residual());
    const MatrixXd covariance = all.covariance();
    for (std::size_t k = 0; k < result_.accepted.size(); ++k) {
      if (result_.accepted[k].source.empty()) continue;
      const double score = remaining_score(problem, change, covariance, result_.accepted[k]);
      if (score >= chance_.limit) continue;
      closed_.push_back(result_.accepted[k].cause);
      remove_from(result_.after, result_.accepted[k].in_model);
      result_.accepted.erase(result_.accepted.begin() + static_cast<std::ptrdiff_t>(k));
      refine(result_.after, result_.batch, result_.unnamed);
      return true;
    }
    return prune_unnamed(problem);
  }

  /// Chooses the forms of causes that have several anew beside all that was found since: chosen while much was missing
  /// they may be others, and what a wrong form leaves over would be given other names.
  void reform() {
    std::vector<std::string> forms;
    for (const ErrorSourcePtr& source : result_.after.model.sources) {
      if (source->cause().forms.size() > 1) forms.push_back(source->name());
    }
    for (const std::string& form : forms) reform(form);
  }

  void reform(const std::string& form) {
    const std::string cause(cause_spelled(form).spelling);
    const bool is_open = std::find(sources_.begin(), sources_.end(), cause) != sources_.end();
    const auto finding = std::find_if(result_.accepted.begin(), result_.accepted.end(),
                                      [&](const Accepted& one) { return one.in_model == form; });
    if (finding == result_.accepted.end() && !is_open) return;
    const VectorXd weight = LinearProblem(result_.after.model, result_.batch, result_.after.priors, {}).weight();
    const VectorXd values = result_.after.model.values(places_of_source(result_.after.model, form));
    const PriorModel now = result_.after;
    double least = held_out_square(now, weight);
    for (const std::string& other : alternatives(cause, *cell_)) {
      if (other == form) continue;
      PriorModel changed = now;
      remove_from(changed, form);
      if (!add_to(changed, other)) continue;
      const std::vector<Index> places = places_of_source(changed.model, other);
      if (static_cast<Index>(places.size()) == values.size()) changed.model.values(places) = values;
      refine(changed, result_.batch, result_.unnamed);
      const double square = held_out_square(changed, weight);
      if (square >= least) continue;
      least = square;
      result_.after = std::move(changed);
      if (finding != result_.accepted.end()) {
        finding->in_model = other;
      } else {
        if (result_.reformed_from.empty()) result_.reformed_from = form;
        result_.reformed_to = other;
      }
    }
  }

  /// Asks of every finding again, all others in place, what it is: while they were missing another cause may have
  /// looked more like it.
  Status reconsider() {
    if (result_.accepted.size() < 2) return {};
    for (std::size_t k = 0; k < result_.accepted.size(); ++k) {
      Accepted& one = result_.accepted[k];
      const bool beyond_doubt = one.could_also_be.empty() && one.best.evidence > kBeyondDoubt * chance_.limit;
      if (one.source.empty() || beyond_doubt) continue;
      const PriorModel with = result_.after;
      remove_from(result_.after, one.in_model);
      refine(result_.after, result_.batch, result_.unnamed);
      const Result<bool> named = name_again(one);
      if (!named) return tl::make_unexpected(named.error());
      if (!*named) result_.after = with;
    }
    return {};
  }

  /// What has the sign that play cannot have is a dependence on the side of approach that has no name.
  void open_negative_play() {
    for (std::size_t k = 0; k < result_.accepted.size();) {
      const Accepted one = result_.accepted[k];
      const bool is_play = record_of(one.cause).search == SearchFamily::kPlay;
      const std::optional<PlaySign> sign = is_play ? std::optional(sign_of(one)) : std::nullopt;
      if (!sign || !sign->negative) {
        ++k;
        continue;
      }
      const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors, {});
      const std::vector<Index> places = places_of_source(problem.model(), one.in_model);
      const std::string joint = std::to_string(one.cause.joint + 1);
      result_.unnamed.push_back({{"q" + joint, "dir" + joint},
                                 problem.weight().cwiseInverse().asDiagonal() * problem.nuisance()(Eigen::all, places),
                                 one.best.evidence - one.penalty,
                                 one.p_value});
      result_.negative_play.push_back(*sign);
      result_.accepted.erase(result_.accepted.begin() + static_cast<std::ptrdiff_t>(k));
      remove_from(result_.after, one.in_model);
      refine(result_.after, result_.batch, result_.unnamed);
    }
  }

  SearchResult take() {
    const bool extended = std::any_of(result_.accepted.begin(), result_.accepted.end(),
                                      [](const Accepted& one) { return !one.source.empty(); });
    // What was tried and dropped leaves no trace.
    if (!extended) {
      result_.after = result_.before;
      result_.reformed_from.clear();
      refine(result_.after, result_.batch, result_.unnamed);
    }
    // Of the pose itself nothing was learned, and by now all else is known.
    for (Accepted& one : result_.accepted) {
      const auto& poses = result_.all.measurements;
      const auto pose =
          std::find_if(poses.begin(), poses.end(), [&](const Measurement& m) { return m.row == one.pose.row; });
      if (one.source.empty() && pose != poses.end())
        one.pose.distance = (pose->p_W - result_.after.model.pose_W(pose->context).translation()).norm();
    }
    result_.chance = std::move(chance_);
    return std::move(result_);
  }

 private:
  /// Of a joint's play, beside all the rest.
  PlaySign sign_of(const Accepted& one) const {
    const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors, {});
    const Background all(background_columns(problem, result_.unnamed));
    return sign_of_play(problem, one.in_model, one.cause.joint, all.estimate(problem.residual()), all.covariance());
  }

  /// Sum of squares of the poses held out, each predicted from the others, in units of `weight`.
  double held_out_square(const PriorModel& prior_model, const VectorXd& weight) const {
    const LinearProblem problem(prior_model.model, result_.batch, prior_model.priors, {});
    const VectorXd left =
        Folds(problem, background_columns(problem, result_.unnamed)).held_out_residual(problem.residual());
    return left.cwiseQuotient(problem.weight()).cwiseProduct(weight).squaredNorm();
  }

  /// The spellings of a source between which poses held out decide: forms of a cause, fewer harmonics of a map.
  std::vector<std::string> spellings(const std::string& source) const {
    if (cause_spelled(source).search != SearchFamily::kMap) return alternatives(source, *cell_);
    const std::size_t at = source.find('@');
    std::vector<std::string> all;
    for (int harmonics = std::stoi(source.substr(at + 1)); harmonics >= kFewestHarmonics; harmonics /= 2)
      all.push_back(source.substr(0, at + 1) + std::to_string(harmonics));
    return all;
  }

  /// Adds `one`'s source, instead of that of `poorer` where there is one, in the form that predicts best, and
  /// identifies everything anew. False, and nothing is changed, where poses held out are predicted no better with it.
  Result<bool> extend(Accepted& one, const Accepted* poorer = nullptr) {
    const VectorXd weight = LinearProblem(result_.after.model, result_.batch, result_.after.priors, {}).weight();
    double least = held_out_square(result_.after, weight);
    PriorModel start = result_.after;
    if (poorer != nullptr) remove_from(start, poorer->in_model);
    std::optional<PriorModel> best;
    for (const std::string& spelling : spellings(one.source)) {
      PriorModel extended = start;
      if (const Status added = add_to(extended, spelling); !added) return tl::make_unexpected(added.error());
      refine(extended, result_.batch, result_.unnamed);
      const double square = held_out_square(extended, weight);
      if (square >= least) continue;
      least = square;
      one.in_model = spelling;
      if (record_of(one.cause).search == SearchFamily::kMap) one.source = spelling;
      best = std::move(extended);
    }
    if (!best) return false;
    result_.after = std::move(*best);
    return true;
  }

  /// The map of that joint among what is accepted: a second one is more of the first.
  auto known_map(const Cause& cause) {
    return std::find_if(result_.accepted.begin(), result_.accepted.end(), [&](const Accepted& one) {
      return record_of(cause).search == SearchFamily::kMap && one.cause.cause == cause.cause &&
             one.cause.joint == cause.joint;
    });
  }

  void renew_chance(const std::vector<FamilyPtr>& families, const Background& background) {
    chance_ = chance_of(families, background, options_.draws, options_.seed);
    renewed_for_ = result_.accepted.size() + result_.unnamed.size();
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

  /// The strongest cause in the place of `one`, which the model is without.
  Result<bool> name_again(Accepted& one) {
    const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors,
                                candidate_sources(*cell_, result_.batch, nullptr));
    const std::vector<FamilyPtr> families = make_families(problem);
    const Background background(background_columns(problem, result_.unnamed));
    const Scan seen = scan(families, {background}, problem.residual(), chance_);
    const auto open = [&](std::size_t f) {
      const auto map = known_map(families[f]->cause(seen.best[f]));
      return families[f]->named() && families[f]->predicts() && !is_closed(*families[f], seen.best[f]) &&
             (map == result_.accepted.end() || &*map == &one);
    };
    auto place = seen.strongest(open);
    if (place) place = simplest(families, seen, *place, open);
    if (place && seen.score[*place] >= chance_.limit) {
      const Family& family = *families[*place];
      const Naming naming = name_or_doubt(problem, families, background, seen, chance_, *place, options_.seed + 1);
      Accepted again = {family.cause(seen.best[*place]),
                        family.source(seen.best[*place]),
                        "",
                        seen.best[*place],
                        chance_.penalty_of(family),
                        chance_.p_value(seen.score[*place]),
                        naming.frequency,
                        naming.could_also_be,
                        {}};
      const Result<bool> extended = extend(again);
      if (extended && *extended) one = again;
      return extended;
    }
    return false;
  }

  /// A step that a cause acting from the first pose on explains nearly as well is that cause; and what a simpler case
  /// of it explains nearly as well is that case: a map of a joint's angle is the disc that is off centre.
  static std::size_t simplest(const std::vector<FamilyPtr>& families, const Scan& seen, std::size_t strongest,
                              const std::function<bool(std::size_t)>& open) {
    const Cause cause = families[strongest]->cause(seen.best[strongest]);
    const auto simpler = seen.strongest([&](std::size_t f) {
      if (!open(f) || !families[f]->named()) return false;
      const Cause other = families[f]->cause(seen.best[f]);
      return is_whole_of(other, cause) || is_simpler_case(other, cause);
    });
    return simpler && seen.score[*simpler] > seen.score[strongest] - kSimplerMargin ? *simpler : strongest;
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
    const MatrixXd all = family.columns(seen.best[place]);
    std::vector<Index> telling;
    for (Index k = 0; k < all.cols(); ++k) {
      if (all.col(k).norm() > kTellingColumn) telling.push_back(k);
    }
    result_.unnamed.push_back({family.depends_on(),
                               problem.weight().cwiseInverse().asDiagonal() * all(Eigen::all, telling),
                               seen.score[place], chance_.p_value(seen.score[place])});
    refine(result_.after, result_.batch, result_.unnamed);
    return true;
  }

  Result<bool> take_named(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                          const Background& background, const MatrixXd& columns, const Scan& seen, std::size_t place,
                          const std::function<bool(std::size_t)>& open) {
    const Family& family = *families[place];
    const Best& best = seen.best[place];
    if (family.predicts() && seen.score[place] < kBeyondDoubt * chance_.limit) {
      // What scores little on all poses is not chosen in a fold that has most of them.
      const auto contends = [&](std::size_t f) {
        return families[f]->named() && families[f]->predicts() && open(f) &&
               seen.score[f] > kContender * seen.score[place];
      };
      const auto gain = Folds(problem, columns).gain_of_selection(problem.residual(), families, chance_, contends);
      if (!(gain.after < gain.before)) {
        closed_.push_back(family.cause(best));
        return true;
      }
    }
    Accepted one{family.cause(best),
                 family.source(best),
                 "",
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
    const auto poorer = known_map(one.cause);
    const Result<bool> extended = extend(one, poorer == result_.accepted.end() ? nullptr : &*poorer);
    if (!extended) return extended;
    if (*extended) {
      if (poorer != result_.accepted.end()) {
        one.p_value = std::min(one.p_value, poorer->p_value);
        result_.accepted.erase(poorer);
      }
      result_.accepted.push_back(std::move(one));
    } else {
      closed_.push_back(one.cause);
    }
    return true;
  }

  Result<bool> take_outlier(const LinearProblem& problem, Accepted one) {
    const auto pose = static_cast<std::size_t>(one.best.at);
    const auto outliers = std::count_if(result_.accepted.begin(), result_.accepted.end(),
                                        [](const Accepted& a) { return a.source.empty(); });
    if (static_cast<double>(outliers) >= kMostOutliers * static_cast<double>(result_.all.measurements.size())) {
      closed_.push_back(one.cause);
      result_.too_many_outliers = true;
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
    refine(result_.after, result_.batch, result_.unnamed);
    return true;
  }

  /// nat: of a finding beside all the rest, from the joint estimate of everything.
  double remaining_score(const LinearProblem& problem, const VectorXd& change, const MatrixXd& covariance,
                         const Accepted& one) const {
    const OwnEstimate own = own_estimate(problem, one.in_model, change, covariance);
    return log_evidence(own.strength(), std::min<double>(one.best.freedom, static_cast<double>(own.size.size()))) -
           one.penalty;
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
  std::vector<std::string> sources_;  // the cell's own list
  std::size_t renewed_for_ = 0;       // how much had been found when chance_ was drawn
  std::vector<Cause> closed_;         // were tried and did not hold
};

}  // namespace

Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
                                   const MeasurementBatch& batch, const DiagnoseOptions& options) {
  Search search(cell, options);
  if (const Status started = search.start(sources, batch); !started) return tl::make_unexpected(started.error());
  bool changed = true;
  for (int k = 0; k < kMostSteps && changed; ++k) {
    if (options.progress && !options.progress("looking for causes", 0.6 * k / kMostSteps)) return given_up();
    Result<bool> more = search.step();
    if (more && !*more) more = search.prune();
    if (!more) return tl::make_unexpected(more.error());
    changed = *more;
    if (changed) search.reform();
  }
  if (const Status again = search.reconsider(); !again) return tl::make_unexpected(again.error());
  search.open_negative_play();
  return search.take();
}

}  // namespace trammel
