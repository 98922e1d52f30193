#include "server/diagnose/search/search.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/search/forms.h"
#include "server/diagnose/search/naming.h"
#include "server/diagnose/search/pruning.h"
#include "server/diagnose/search/slow_rival.h"
#include "server/diagnose/search/standing.h"
#include "server/diagnose/search/whole_list.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 40;        // forward and backward: no batch has needed half of them
constexpr double kShareOfWork = 0.6;  // of a diagnosis, for the line of progress
constexpr double kTellingColumn =
    0.1;  // standard deviations over all rows together: smaller effects are left out

std::vector<Parameter> priors_of(const CalibrationResult& calibration) {
  std::vector<Parameter> priors;
  for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  return priors;
}

/// Without `count` rows from `first` on.
void drop_rows(MatrixXd& columns, Index first, Index count) {
  MatrixXd kept(columns.rows() - count, columns.cols());
  kept << columns.topRows(first), columns.bottomRows(columns.rows() - first - count);
  columns = std::move(kept);
}

/// The name of the cause's source in the model, which may have one of its forms.
std::string name_in(const PhysicalModel& model, const Cause& cause) {
  const auto source =
      std::find_if(model.sources.begin(), model.sources.end(),
                   [&](const ErrorSourcePtr& one) { return one->cause().spelling == cause.cause; });
  return source == model.sources.end() ? to_string(cause) : (*source)->name();
}

std::vector<Measurement>::const_iterator place_in(const MeasurementBatch& batch, int row) {
  return std::find_if(batch.measurements.begin(), batch.measurements.end(),
                      [&](const Measurement& m) { return m.row == row; });
}

/// Forward and backward selection. After every step `result_` has a model that is identified beside
/// all findings.
class Search {
 public:
  Search(std::shared_ptr<const Cell> cell, const DiagnoseOptions& options)
      : cell_(std::move(cell)), options_(options) {}

  [[nodiscard]] Status start(const std::vector<std::string>& sources,
                             const MeasurementBatch& batch);
  /// Accepts one more cause or function, or closes one that does not hold. Returns false if nothing
  /// passes.
  [[nodiscard]] Result<bool> step();
  /// Drops a cause that no longer passes beside all others; false if all pass.
  [[nodiscard]] bool prune();
  /// Chooses the form of each cause in the model anew; false if none changes.
  [[nodiscard]] bool choose_forms_again() {
    return cause_search::choose_forms_again(result_, own_sources_);
  }
  /// Puts a cause of the list in the place of all that has no name; false where none explains it.
  [[nodiscard]] bool name_functions();
  /// True if so many findings are new since the forms were chosen that the forms may change.
  [[nodiscard]] bool is_time_for_forms();
  /// Asks for the best name of every finding again with all others in place. While they were
  /// missing, another cause may have fitted better.
  [[nodiscard]] Status reconsider();
  /// Returns outliers to the batch that fit now that the missing cause was found.
  void take_back_outliers();
  /// Turns a cause whose numbers have an impossible sign into a nameless dependence.
  [[nodiscard]] Status open_wrong_signs();
  [[nodiscard]] SearchResult take();

 private:
  [[nodiscard]] Scan scan_beside_all(const Standing& standing);
  void renew_chance(const Standing& standing);
  [[nodiscard]] Choice choice_of(const Standing& standing, Scan seen) const;
  [[nodiscard]] bool is_closed(const Cause& cause) const;
  [[nodiscard]] bool is_dropped(const Family& family) const;
  [[nodiscard]] bool is_function(const Standing& standing, const Choice& choice, std::size_t best,
                                 std::optional<std::size_t> named) const;
  [[nodiscard]] double named_path_score(const Standing& standing, const Admitted& open) const;
  [[nodiscard]] bool holds_in_folds(const Standing& standing, const Choice& choice,
                                    std::size_t place) const;
  [[nodiscard]] double gain_by_refining(const Standing& standing, const Scan& seen,
                                        std::size_t place) const;
  [[nodiscard]] std::optional<SlowRival> slow_instead(const Standing& standing, const Scan& seen,
                                                      std::size_t place) const;
  [[nodiscard]] Accepted accepted(const Standing& standing, const Scan& seen,
                                  std::size_t place) const;

  /// `columns`: R x k, whitened, of the fitted size.
  void take_function(const LinearProblem& problem, const MatrixXd& columns,
                     const std::vector<std::string>& depends_on, const std::string& wanderer,
                     double score);
  [[nodiscard]] Status take_named(const Standing& standing, const Choice& choice,
                                  std::size_t place);
  [[nodiscard]] std::vector<Accepted> all_out(const Standing& standing, const Scan& seen,
                                              std::size_t place) const;
  void take_outliers(const LinearProblem& problem, std::vector<Accepted> out);
  void take_outlier(const LinearProblem& problem, Accepted one);
  [[nodiscard]] Status take_cause(Accepted one);
  [[nodiscard]] Result<bool> name_again(Accepted& one);

  [[nodiscard]] std::vector<Accepted>::iterator known_map(const Cause& cause);
  /// All numbers of the model and the functions, beside each other.
  struct Together;
  [[nodiscard]] bool fits_beside_the_others(const Measurement& pose);
  [[nodiscard]] PlaySign play_of(const Accepted& one) const;
  [[nodiscard]] WrongSign sign_of(const Accepted& one) const;
  [[nodiscard]] bool open_wrong_sign(Accepted& one);
  [[nodiscard]] Status ask_again_for(const Accepted& one);
  void make_unnamed(const Accepted& one, const std::vector<std::string>& depends_on);
  void refine_all() { refine(result_.after, result_.batch, result_.unnamed); }

  std::shared_ptr<const Cell> cell_;
  const DiagnoseOptions& options_;
  SearchResult result_;
  Chance chance_;
  std::vector<std::string> own_sources_;  // as the cell lists them
  std::size_t renewed_for_ = 0;           // the number of findings when chance_ was drawn
  std::size_t formed_for_ = 0;            // the same when the forms were chosen last
  std::vector<Cause> closed_;             // were tried and did not hold
  std::vector<std::vector<std::string>> dropped_functions_;  // by the quantities on which they
                                                             // depend
  std::vector<Accepted> wrong_;  // those of them with the wrong sign at the time
};

struct Search::Together {
  explicit Together(const SearchResult& result)
      : problem(result.after.model, result.batch, result.after.priors, {}),
        all(background_columns(problem, result.unnamed)),
        change(all.estimate(problem.residual())),
        covariance(all.covariance()) {}
  LinearProblem problem;
  Background all;
  VectorXd change;
  MatrixXd covariance;
};

Status Search::start(const std::vector<std::string>& sources, const MeasurementBatch& batch) {
  result_.all = result_.batch = batch;
  const CalibrationResult calibration = TRY(calibrate(cell_, sources, batch, {}));
  own_sources_ = sources;
  result_.before = {calibration.model, priors_of(calibration)};
  result_.after = result_.before;
  return {};
}

Result<bool> Search::step() {
  const Standing standing(result_);
  const Choice choice = choice_of(standing, scan_beside_all(standing));
  const auto best = choice.best();
  if (!best || choice.seen.score[*best] < chance_.limit) return false;
  const auto named = best_named(standing.families, choice);
  if (is_function(standing, choice, *best, named)) {
    const Family& family = *standing.families[*best];
    take_function(standing.problem, family.columns(choice.seen.best[*best]), family.depends_on(),
                  family.wanderer(), choice.seen.score[*best]);
    return true;
  }
  TRY(take_named(standing, choice, *named));
  return true;
}

/// Draws the chance limit anew if it was never drawn, and if the best score is so near to it that
/// the limit for the present background is needed.
Scan Search::scan_beside_all(const Standing& standing) {
  if (chance_.null_score.size() == 0) renew_chance(standing);
  Scan seen = standing.scan(chance_);
  const auto best = choice_of(standing, seen).best();
  const bool renewed = renewed_for_ == result_.accepted.size() + result_.unnamed.size();
  if (!best || renewed) return seen;
  const double score = seen.score[*best];
  const auto& [below, above] = thresholds::kNearLine;
  if (!(score > below * chance_.limit && score < above * chance_.limit)) return seen;
  renew_chance(standing);
  return standing.scan(chance_);
}

void Search::renew_chance(const Standing& standing) {
  chance_ = chance_of(standing.families, standing.background, options_.draws, options_.seed);
  renewed_for_ = result_.accepted.size() + result_.unnamed.size();
}

Choice Search::choice_of(const Standing& standing, Scan seen) const {
  std::vector<bool> open;
  for (std::size_t f = 0; f < seen.best.size(); ++f)
    open.push_back(!is_closed(standing.families[f]->cause(seen.best[f])) &&
                   !is_dropped(*standing.families[f]));
  return {std::move(seen), [open = std::move(open)](std::size_t f) { return open[f]; }};
}

/// True for a function that passed once, and later failed beside the others. Without this check it
/// would repeat that forever.
bool Search::is_dropped(const Family& family) const {
  return !family.named() && std::find(dropped_functions_.begin(), dropped_functions_.end(),
                                      family.depends_on()) != dropped_functions_.end();
}

bool Search::is_closed(const Cause& cause) const {
  return std::any_of(closed_.begin(), closed_.end(), [&](const Cause& one) {
    return one.cause == cause.cause && one.joint == cause.joint &&
           one.parameter == cause.parameter && one.pose_id == cause.pose_id &&
           (!one.order || !cause.order ||
            std::abs(*one.order - *cause.order) < thresholds::kSameOrder);
  });
}

/// True if an anonymous function explains more than any named cause, and more than a few named
/// causes together.
bool Search::is_function(const Standing& standing, const Choice& choice, std::size_t best,
                         std::optional<std::size_t> named) const {
  if (standing.families[best]->named()) return false;
  if (!named) return true;
  const std::vector<double>& score = choice.seen.score;
  const bool is_slow = !standing.families[best]->wanderer().empty();
  const bool is_step = !standing.families[*named]->cause(choice.seen.best[*named]).pose_id.empty();
  const double refined = is_slow && is_step ? gain_by_refining(standing, choice.seen, *named) : 0;
  return score[best] > score[*named] + refined +
                           (is_slow ? thresholds::kSlowInstead : thresholds::kUnnamedMargin) &&
         named_path_score(standing, choice.open) < score[best];
}

/// nat: the joint gain of the best few named causes, taken one after the other.
double Search::named_path_score(const Standing& standing, const Admitted& open) const {
  MatrixXd columns = standing.columns;
  std::optional<Background> with_steps;
  std::vector<std::size_t> steps;  // taken already
  double total = 0;
  for (int k = 0; k < thresholds::kNamedPath; ++k) {
    const Background& background = with_steps ? std::as_const(*with_steps) : standing.background;
    // A second step of one cause only turns the first step into a better ramp.
    const auto is_new = [&](std::size_t f) {
      const Cause cause = standing.families[f]->cause(standing.families[f]->typical());
      return cause.pose_id.empty() || std::find(steps.begin(), steps.end(), f) == steps.end();
    };
    const Scan seen =
        scan(standing.families, {background}, standing.problem.residual(), chance_,
             [&](std::size_t f) { return standing.families[f]->named() && open(f) && is_new(f); });
    const auto best = seen.strongest([](std::size_t) { return true; });
    if (!best || seen.score[*best] < chance_.limit) break;
    total += seen.score[*best];
    steps.push_back(*best);
    const MatrixXd chosen = standing.families[*best]->columns(seen.best[*best]);
    columns.conservativeResize(Eigen::NoChange, columns.cols() + chosen.cols());
    columns.rightCols(chosen.cols()) = chosen;
    if (k + 1 < thresholds::kNamedPath) with_steps.emplace(columns);
  }
  return total;
}

/// True if poses held out are predicted better where every fold chooses its cause by itself.
bool Search::holds_in_folds(const Standing& standing, const Choice& choice,
                            std::size_t place) const {
  const std::vector<double>& score = choice.seen.score;
  if (!standing.families[place]->predicts() ||
      score[place] >= thresholds::kBeyondFolds * chance_.limit)
    return true;
  const auto contends = [&](std::size_t f) {
    return standing.families[f]->named() && standing.families[f]->predicts() && choice.open(f) &&
           score[f] > thresholds::kFoldContender * score[place];
  };
  const auto gain =
      Folds(standing.problem, standing.columns)
          .gain_of_selection(standing.problem.residual(), standing.families, chance_, contends);
  return gain.after < gain.before;
}

/// Nat: by how much the step at `place` explains more when it is refined than to first order, of
/// which a large step falls short. Weighed as stated: what it leaves to first order is no noise.
double Search::gain_by_refining(const Standing& standing, const Scan& seen,
                                std::size_t place) const {
  SearchResult with = result_;
  if (!add_to(with.after, standing.families[place]->source(seen.best[place]))) return 0;
  refine(with.after, with.batch, with.unnamed, Weighed::kAsStated);
  const VectorXd residual = standing.problem.residual();
  const VectorXd projected = standing.background.project(residual);
  const double after = standing.problem.residual_of(with.after.model).squaredNorm();
  return std::max(0.0, 0.5 * (residual.dot(projected) - after - seen.best[place].strength));
}

/// The slow rival of the family at `place`. It is judged to first order, the family refined.
std::optional<SlowRival> Search::slow_instead(const Standing& standing, const Scan& seen,
                                              std::size_t place) const {
  std::optional<SlowRival> slow = slow_rival(standing, seen, place);
  if (slow) slow->gap -= gain_by_refining(standing, seen, place);
  return slow;
}

/// The cause at `place`, and how sure its name is.
Accepted Search::accepted(const Standing& standing, const Scan& seen, std::size_t place) const {
  const Family& family = *standing.families[place];
  Accepted one;
  one.cause = family.cause(seen.best[place]);
  one.source = family.source(seen.best[place]);
  one.best = seen.best[place];
  one.penalty = chance_.penalty_of(family);
  one.p_value = chance_.p_value(seen.score[place]);
  if (!family.predicts()) return one;
  Naming naming = name_or_doubt(standing.problem, standing.families, standing.background, seen,
                                chance_, place, options_.seed + kNamingDraw);
  one.naming_frequency = naming.frequency;
  one.could_also_be = std::move(naming.could_also_be);
  const auto slow = slow_instead(standing, seen, place);
  const double ahead =
      std::max(0.0, thresholds::kStepShare * one.best.strength - thresholds::kStepChance);
  if (slow && slow->gap > -ahead) one.could_also_be.push_back(unknown_cause(one.cause.joint));
  return one;
}

void Search::take_function(const LinearProblem& problem, const MatrixXd& columns,
                           const std::vector<std::string>& depends_on, const std::string& wanderer,
                           double score) {
  std::vector<Index> telling;
  for (Index k = 0; k < columns.cols(); ++k) {
    if (columns.col(k).norm() > kTellingColumn) telling.push_back(k);
  }
  result_.unnamed.push_back(
      {depends_on, problem.weight().cwiseInverse().asDiagonal() * columns(Eigen::all, telling),
       score, chance_.p_value(score), wanderer});
  refine_all();
}

Status Search::take_named(const Standing& standing, const Choice& choice, std::size_t place) {
  if (!holds_in_folds(standing, choice, place)) {
    closed_.push_back(standing.families[place]->cause(choice.seen.best[place]));
    return {};
  }
  const auto slow = slow_instead(standing, choice.seen, place);
  if (slow && slow->gap > thresholds::kSlowInstead) {
    take_function(standing.problem, slow->columns, slow->depends_on, slow->wanderer,
                  choice.seen.score[place] + slow->gap);
    return {};
  }
  if (standing.families[place]->predicts())
    return take_cause(accepted(standing, choice.seen, place));
  take_outliers(standing.problem, all_out(standing, choice.seen, place));
  return {};
}

/// The pose at `place` of the scan, and the other poses that are nearly as far out: they need no
/// scan of their own.
std::vector<Accepted> Search::all_out(const Standing& standing, const Scan& seen,
                                      std::size_t place) const {
  const Family& family = *standing.families[place];
  const VectorXd projected = standing.background.project(standing.problem.residual());
  const double enough =
      std::max(thresholds::kOutAsWell * seen.best[place].evidence,
               chance_.penalty_of(family) + thresholds::kBeyondFolds * chance_.limit);
  std::vector<Accepted> out;
  VectorXd keep = VectorXd::Ones(standing.problem.rows());
  Scan next = seen;
  do {
    out.push_back(accepted(standing, next, place));
    const Index pose = next.best[place].pose;
    keep.segment(standing.problem.first_row(pose), standing.problem.row_count(pose)).setZero();
    next.best[place] = family.scan({standing.background, &keep}, projected).front();
    next.score[place] = next.best[place].evidence - chance_.penalty_of(family);
  } while (next.best[place].evidence >= enough);
  return out;
}

void Search::take_outliers(const LinearProblem& problem, std::vector<Accepted> out) {
  // The last first, so that the places of the others stay valid.
  std::sort(out.begin(), out.end(),
            [](const Accepted& a, const Accepted& b) { return a.best.pose > b.best.pose; });
  for (Accepted& one : out) take_outlier(problem, std::move(one));
  refine_all();
}

void Search::take_outlier(const LinearProblem& problem, Accepted one) {
  const auto outliers = std::count_if(result_.accepted.begin(), result_.accepted.end(),
                                      [](const Accepted& a) { return a.is_outlier(); });
  const auto poses = static_cast<double>(result_.all.measurements.size());
  if (static_cast<double>(outliers) >= thresholds::kMostOutliers * poses) {
    closed_.push_back(one.cause);
    result_.too_many_outliers = true;
    return;
  }
  const Index pose = one.best.pose;
  const auto out = result_.batch.measurements.begin() + pose;
  one.pose = {.pose_id = out->pose_id,
              .row = out->row,
              .distance = problem.positions(problem.residual()).col(pose).norm(),
              .reason = "single pose, cause not separable: repeat it and its neighbours"};
  result_.batch.measurements.erase(out);
  for (Unnamed& function : result_.unnamed) {
    drop_rows(function.columns, problem.first_row(pose), problem.row_count(pose));
  }
  result_.accepted.push_back(std::move(one));
}

/// Puts the cause into the model. A second map of a joint is more of the first, and takes its
/// place.
Status Search::take_cause(Accepted one) {
  const auto poorer = known_map(one.cause);
  const bool is_known = poorer != result_.accepted.end();
  const bool added = TRY(add_in_best_form(result_, one, is_known ? &*poorer : nullptr));
  if (!added) {
    closed_.push_back(one.cause);
    return {};
  }
  if (is_known) {
    one.p_value = std::min(one.p_value, poorer->p_value);
    result_.accepted.erase(poorer);
  }
  // Play is opened at the end: its sign is asked pose by pose.
  const bool is_play = record_of(one.cause).search == causes::SearchFamily::kPlay;
  if (!is_play && sign_of(one).is_another_cause()) {
    remove_from(result_.after, one.in_model);
    refine_all();
    closed_.push_back(one.cause);
    wrong_.push_back(std::move(one));
    return {};
  }
  result_.accepted.push_back(std::move(one));
  return {};
}

/// The map of that joint among the accepted causes.
std::vector<Accepted>::iterator Search::known_map(const Cause& cause) {
  const bool is_map = record_of(cause).search == causes::SearchFamily::kMap;
  return std::find_if(result_.accepted.begin(), result_.accepted.end(), [&](const Accepted& one) {
    return is_map && one.cause.cause == cause.cause && one.cause.joint == cause.joint;
  });
}

/// With more parts, one additional part changes less. So the number rises by half each time.
bool Search::is_time_for_forms() {
  const std::size_t found = result_.accepted.size() + result_.unnamed.size();
  if (2 * found <= 3 * formed_for_ && found >= formed_for_) return false;
  formed_for_ = found;
  return true;
}

bool Search::prune() {
  if (const auto weak = weak_cause(result_, chance_.limit)) {
    const auto one = result_.accepted.begin() + static_cast<std::ptrdiff_t>(*weak);
    closed_.push_back(one->cause);
    remove_from(result_.after, one->in_model);
    result_.accepted.erase(one);
    refine_all();
    return true;
  }
  const auto weak = weak_function(result_, chance_.limit);
  if (!weak) return false;
  const auto one = result_.unnamed.begin() + static_cast<std::ptrdiff_t>(*weak);
  dropped_functions_.push_back(one->depends_on);
  result_.unnamed.erase(one);
  refine_all();
  return true;
}

bool Search::name_functions() {
  std::optional<NamedInstead> instead = named_instead_of_functions(result_, closed_);
  if (!instead) return false;
  result_.after = std::move(instead->model);
  result_.unnamed.clear();
  Accepted one;
  one.cause = instead->cause;
  one.source = to_string(one.cause);
  one.in_model = name_in(result_.after.model, one.cause);
  one.could_also_be = std::move(instead->rivals);
  for (const Cause& rival : untestable_rivals(one.cause, result_.batch)) {
    auto& others = one.could_also_be;
    if (std::find(others.begin(), others.end(), rival) == others.end()) others.push_back(rival);
  }
  const Together now(result_);
  const OwnEstimate own = own_estimate(now.problem, one.in_model, now.change, now.covariance);
  one.best.freedom = static_cast<int>(own.size.size());
  one.best.strength = own.strength();
  one.best.evidence = log_evidence(one.best.strength, one.best.freedom);
  const auto penalty = chance_.penalty.find(one.source);
  one.penalty = penalty == chance_.penalty.end() ? 0 : penalty->second;
  one.p_value = chance_.p_value(one.best.evidence - one.penalty);
  result_.accepted.push_back(std::move(one));
  return true;
}

Status Search::reconsider() {
  if (result_.accepted.size() < 2) return {};
  for (Accepted& one : result_.accepted) {
    const bool beyond_doubt =
        one.could_also_be.empty() && one.best.evidence > thresholds::kBeyondFolds * chance_.limit;
    if (one.is_outlier() || beyond_doubt) continue;
    const PriorModel with = result_.after;
    remove_from(result_.after, one.in_model);
    refine_all();
    const bool named = TRY(name_again(one));
    if (!named) result_.after = with;
  }
  return {};
}

/// The strongest cause in the place of `one`, which the model is without; false where none passes.
Result<bool> Search::name_again(Accepted& one) {
  const Standing standing(result_);
  Choice choice = choice_of(standing, standing.scan(chance_));
  choice.open = [&, open = choice.open](std::size_t f) {
    const auto map = known_map(standing.families[f]->cause(choice.seen.best[f]));
    return open(f) && standing.families[f]->predicts() &&
           (map == result_.accepted.end() || &*map == &one);
  };
  const auto place = best_named(standing.families, choice);
  if (!place || choice.seen.score[*place] < chance_.limit) return false;
  Accepted again = accepted(standing, choice.seen, *place);
  const Result<bool> added = add_in_best_form(result_, again, nullptr);
  if (added && *added) one = again;
  return added;
}

void Search::take_back_outliers() {
  if (!result_.unnamed.empty()) return;  // their functions have no rows for these poses
  for (std::size_t k = 0; k < result_.accepted.size();) {
    const Accepted& one = result_.accepted[k];
    const auto out =
        one.is_outlier() ? place_in(result_.all, one.pose.row) : result_.all.measurements.cend();
    if (out == result_.all.measurements.cend() || !fits_beside_the_others(*out)) {
      ++k;
      continue;
    }
    result_.accepted.erase(result_.accepted.begin() + static_cast<std::ptrdiff_t>(k));
  }
}

/// True if the outlier fits when the model learns from it as well; then it returns to the batch. An
/// isolated pose may show the largest part of a missing effect, since no other pose determines its
/// place.
bool Search::fits_beside_the_others(const Measurement& pose) {
  MeasurementBatch batch = result_.batch;
  auto& all = batch.measurements;
  const auto after = std::find_if(all.begin(), all.end(), [&](const Measurement& m) {
    return m.context.index > pose.context.index;
  });
  const Index at = after - all.begin();
  all.insert(after, pose);
  PriorModel with = result_.after;
  refine(with, batch, {});
  const LinearProblem problem(with.model, batch, with.priors, {});
  const VectorXd left = Background(problem.nuisance()).project(problem.residual());
  const double distance = left.segment(problem.first_row(at), problem.row_count(at)).norm();
  if (distance > thresholds::kFitsOtherwise) return false;
  result_.batch = std::move(batch);
  result_.after = std::move(with);
  return true;
}

Status Search::open_wrong_signs() {
  for (std::size_t k = 0; k < result_.accepted.size();) {
    Accepted one = result_.accepted[k];
    const bool opened = !one.is_outlier() && open_wrong_sign(one);
    result_.accepted[k] = one;
    if (opened) {
      result_.accepted.erase(result_.accepted.begin() + static_cast<std::ptrdiff_t>(k));
      remove_from(result_.after, one.in_model);
      refine_all();
    } else {
      ++k;
    }
  }
  for (const Accepted& one : std::exchange(wrong_, {})) {
    TRY(ask_again_for(one));
  }
  return {};
}

/// True if the sign shows that `one`, which is in the model, is another cause; then it becomes a
/// nameless function. If only a part of it has the wrong sign, an unknown effect becomes its rival.
bool Search::open_wrong_sign(Accepted& one) {
  if (record_of(one.cause).search == causes::SearchFamily::kPlay) {
    const PlaySign sign = play_of(one);
    if (!sign.negative) return false;
    const std::string joint = std::to_string(one.cause.joint + 1);
    make_unnamed(one, {"q" + joint, "dir" + joint});
    result_.negative_play.push_back(sign);
    return true;
  }
  const WrongSign sign = sign_of(one);
  if (sign.is_another_cause()) {
    make_unnamed(one, sign.depends_on);
    result_.wrong_signs.push_back(sign);
    return true;
  }
  if (sign.is_beyond_chance()) one.could_also_be.push_back(unknown_cause(one.cause.joint));
  return false;
}

/// Tests again, with all other findings in place, whether `one`, which was removed for its sign, is
/// there. It may return with a name or as a nameless function.
Status Search::ask_again_for(const Accepted& one) {
  if (!add_to(result_.after, one.in_model)) return {};  // the model has another form of it
  refine_all();
  const Together now(result_);
  const OwnEstimate own = own_estimate(now.problem, one.in_model, now.change, now.covariance);
  const double freedom = std::min<double>(one.best.freedom, static_cast<double>(own.size.size()));
  Accepted again = one;
  const bool is_there = log_evidence(own.strength(), freedom) - one.penalty >= chance_.limit;
  if (is_there && !open_wrong_sign(again)) {
    result_.accepted.push_back(std::move(again));
    return {};
  }
  remove_from(result_.after, one.in_model);
  refine_all();
  return {};
}

/// The sign of a joint's play, beside all the rest.
PlaySign Search::play_of(const Accepted& one) const {
  const Together now(result_);
  return sign_of_play(now.problem, one.in_model, one.cause.joint, now.change, now.covariance);
}

/// The sign of the numbers of any other cause.
WrongSign Search::sign_of(const Accepted& one) const {
  const Together now(result_);
  return wrong_sign_of(now.problem, one.in_model, one.cause, now.change, now.covariance);
}

/// Turns the effect of `one` on the poses into a nameless function.
void Search::make_unnamed(const Accepted& one, const std::vector<std::string>& depends_on) {
  const LinearProblem problem(result_.after.model, result_.batch, result_.after.priors, {});
  const std::vector<Index> places = places_of_source(problem.model(), one.in_model);
  result_.unnamed.push_back(
      {depends_on,
       problem.weight().cwiseInverse().asDiagonal() * problem.nuisance()(Eigen::all, places),
       one.best.evidence - one.penalty, one.p_value});
}

SearchResult Search::take() {
  const bool extended = std::any_of(result_.accepted.begin(), result_.accepted.end(),
                                    [](const Accepted& one) { return !one.is_outlier(); });
  // Causes that were tried and dropped leave no trace.
  if (!extended) {
    result_.after = result_.before;
    result_.reformed.clear();
    refine_all();
  }
  // The model did not learn from the outlier itself, and by now all other effects are known.
  for (Accepted& one : result_.accepted) {
    const auto pose = place_in(result_.all, one.pose.row);
    if (one.is_outlier() && pose != result_.all.measurements.end())
      one.pose.distance =
          (pose->p_W - result_.after.model.pose_W(pose->context).translation()).norm();
  }
  result_.chance = std::move(chance_);
  return std::move(result_);
}

}  // namespace

Result<SearchResult> search_causes(const std::shared_ptr<const Cell>& cell,
                                   const std::vector<std::string>& sources,
                                   const MeasurementBatch& batch, const DiagnoseOptions& options) {
  Search search(cell, options);
  TRY(search.start(sources, batch));
  bool changed = true;
  for (int k = 0; k < kMostSteps && changed; ++k) {
    TRY(report_progress(options, "looking for causes", kShareOfWork * k / kMostSteps));
    const bool more = TRY(search.step());
    changed = more || search.prune();
    if (!changed || search.is_time_for_forms()) changed = search.choose_forms_again() || changed;
    if (!changed) changed = search.name_functions();
  }
  search.take_back_outliers();
  TRY(search.reconsider());
  TRY(search.open_wrong_signs());
  return search.take();
}

}  // namespace trammel::cause_search
