#include "server/diagnose/tell/findings.h"

#include <algorithm>
#include <cmath>

#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/diagnose/evidence/beginning.h"
#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/tell/doubts.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"
#include "server/robot/arm_state.h"

namespace trammel::cause_search {

namespace {

using causes::Summary;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::ptrdiff_t kMostAccidents = 3;  // poses that are out beside something unexplained
constexpr Index kBlocksOfHalves =
    16;  // of consecutive poses, taken alternately: each half covers the whole day

/// The joint estimate of everything, about the model's values, in units of priors.
struct Estimated {
  VectorXd change;
  MatrixXd covariance;
};

/// Every free column on a half of the poses.
struct Half {
  std::vector<Index> rows;
  Background columns;
};

Estimate in_units(const Parameter& parameter, double value, double stddev) {
  return {parameter.name, parameter.unit, parameter.scale * value,
          parameter.scale * kExpanded * stddev};
}

/// The common amplitude of a sine and a cosine, and its uncertainty.
Estimate amplitude_of(const std::string& name, const Eigen::Vector2d& value,
                      const Eigen::Matrix2d& covariance) {
  const double amplitude = value.norm();
  const Eigen::Vector2d slope =
      amplitude > 0 ? Eigen::Vector2d(value / amplitude) : Eigen::Vector2d::UnitX();
  return {name, "urad", 1e6 * amplitude,
          1e6 * kExpanded * std::sqrt(slope.dot(covariance * slope))};
}

/// The difference of a joint's error between the two poses where its map differs most. `values`: a
/// sine and a cosine of every harmonic, rad.
Estimate peak_to_peak_of(const LinearProblem& problem, int joint, const VectorXd& values,
                         const MatrixXd& covariance) {
  const auto functions = [&](double q) {
    VectorXd f(values.size());
    for (Index h = 0; 2 * h + 1 < f.size(); ++h) {
      f(2 * h) = std::sin(static_cast<double>(h + 1) * q);
      f(2 * h + 1) = std::cos(static_cast<double>(h + 1) * q);
    }
    return f;
  };
  VectorXd lowest;
  VectorXd highest;
  for (Index i = 0; i < problem.poses(); ++i) {
    const VectorXd here = functions(problem.gear_angles(i)(joint));
    if (lowest.size() == 0 || values.dot(here) < values.dot(lowest)) lowest = here;
    if (highest.size() == 0 || values.dot(here) > values.dot(highest)) highest = here;
  }
  const VectorXd across = highest - lowest;
  return {"peak_to_peak", "urad", 1e6 * values.dot(across),
          1e6 * kExpanded * std::sqrt(across.dot(covariance * across))};
}

std::vector<Estimate> parameters_of(const LinearProblem& problem, const std::string& source,
                                    const Cause& cause, const Estimated& estimated) {
  const std::vector<Index> places = places_of_source(problem.model(), source);
  std::vector<Estimate> estimates;
  VectorXd values(static_cast<Index>(places.size()));
  MatrixXd covariance(values.size(), values.size());
  const auto& priors = problem.nuisance_parameters();
  for (Index i = 0; i < values.size(); ++i) {
    const Index k = places[static_cast<std::size_t>(i)];
    const double scale = priors[static_cast<std::size_t>(k)].prior_scale;
    values(i) = problem.model().values(k) + scale * estimated.change(k);
    for (Index j = 0; j < values.size(); ++j) {
      const Index other = places[static_cast<std::size_t>(j)];
      covariance(i, j) = scale * priors[static_cast<std::size_t>(other)].prior_scale *
                         estimated.covariance(k, other);
    }
  }
  const Summary summary = record_of(cause).summary;
  if (summary == Summary::kOrderAndAmplitude) {
    estimates.push_back({"order", "", values(0), kExpanded * std::sqrt(covariance(0, 0))});
    estimates.push_back(
        amplitude_of("amplitude", values.segment<2>(1), covariance.block<2, 2>(1, 1)));
  } else if (summary == Summary::kAmplitude) {
    estimates.push_back(
        amplitude_of("amplitude", values.head<2>(), covariance.topLeftCorner<2, 2>()));
  } else if (summary == Summary::kPeakToPeak && values.size() > 0) {
    estimates.push_back(peak_to_peak_of(problem, cause.joint, values, covariance));
  }
  if (!cause.parameter.empty()) {
    const OwnEstimate own = own_estimate(problem, source, estimated.change, estimated.covariance);
    for (Index i = 0; i < values.size(); ++i) {
      const Parameter& parameter =
          priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])];
      if (parameter.name != cause.parameter) continue;
      // The others of its source are set to zero, since this one is named.
      const double alone = own.precision.row(i).dot(own.size) / own.precision(i, i);
      return {in_units(parameter, parameter.prior_scale * alone,
                       parameter.prior_scale / std::sqrt(own.precision(i, i)))};
    }
  }
  for (Index i = 0; i < values.size(); ++i) {
    const Parameter& parameter =
        priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])];
    if (parameter.is_place) continue;
    if (summary == Summary::kPeakToPeak) break;  // a hundred harmonics tell people nothing
    estimates.push_back(in_units(parameter, values(i), std::sqrt(covariance(i, i))));
  }
  return estimates;
}

/// True if other numbers of the source are present besides the number that names the cause. That
/// number was estimated with the others at zero, which would then be wrong.
bool others_speak(const LinearProblem& problem, const Accepted& one, const Estimated& estimated) {
  if (one.cause.parameter.empty()) return false;
  const OwnEstimate own =
      own_estimate(problem, one.in_model, estimated.change, estimated.covariance);
  const std::vector<Index> places = places_of_source(problem.model(), one.in_model);
  const auto& priors = problem.nuisance_parameters();
  for (Index i = 0; i < own.size.size(); ++i) {
    if (priors[static_cast<std::size_t>(places[static_cast<std::size_t>(i)])].name !=
        one.cause.parameter)
      continue;
    const double alone = std::pow(own.precision.row(i).dot(own.size), 2) / own.precision(i, i);
    return log_evidence(own.strength() - alone, static_cast<double>(own.size.size() - 1)) >
           thresholds::kOthersSpeak;
  }
  return false;
}

std::vector<Index> all_but(Index count, const std::vector<Index>& left_out) {
  std::vector<Index> kept;
  for (Index k = 0; k < count; ++k) {
    if (std::find(left_out.begin(), left_out.end(), k) == left_out.end()) kept.push_back(k);
  }
  return kept;
}

/// The quantities in which a pose may lie at the edge of all poses: the angles of the gears, the
/// torques on them, and the reach of the arm.
VectorXd posture_of(const PhysicalModel& model, const PoseContext& context) {
  const ArmState state = model.state(context);
  const JointVector gears = model.cell->robot.gear_angles(context.q);
  const VectorXd torques = ArmKinematics(state).gravity_torque();
  VectorXd posture(gears.size() + torques.size() + 1);
  posture << gears, torques,
      (model.X_WB.inverse() * ArmKinematics(state).tool_pose_W()).translation().norm();
  return posture;
}

/// A search's findings, measured beside each other.
class Findings {
 public:
  Findings(const SearchResult& found, const LinearProblem& problem, const Unexplained& unexplained,
           const Surrogates& surrogates, const MeasurementBatch& recorded,
           const Remainder& remainder);

  [[nodiscard]] Finding of(const Accepted& one) const {
    return one.is_outlier() ? outlier(one) : cause(one);
  }

 private:
  [[nodiscard]] Finding outlier(const Accepted& one) const;
  [[nodiscard]] bool is_beyond_others(const Accepted& one) const;
  /// True if the pose may be where something is large that the simulation lacks.
  [[nodiscard]] bool may_show_what_lacks(const Accepted& one) const;
  [[nodiscard]] Finding cause(const Accepted& one) const;
  /// The reported cause: with one number only if that number is alone.
  [[nodiscard]] Cause named(const Accepted& one) const;
  /// The poses at which `one` may have begun, given its `effect` and all other free columns
  /// (`rest`).
  [[nodiscard]] std::vector<PossibleBeginning> beginnings(const Accepted& one,
                                                          const VectorXd& effect,
                                                          const Background& rest) const;
  /// True if every second block of poses, and the remaining blocks, each show `one` by themselves.
  /// `effect`: that of `one`, with the columns `others` free.
  [[nodiscard]] bool is_in_both_halves(const Accepted& one, const VectorXd& effect,
                                       const std::vector<Index>& others) const;
  /// True if `one`, which does `effect` and always acts, did so more at some times or temperatures
  /// than at others.
  [[nodiscard]] bool changes_size(const Accepted& one, const VectorXd& effect) const;
  /// The family of `one`; null where it does not begin at a pose.
  [[nodiscard]] const Family* step_family(const Accepted& one) const;

  const LinearProblem& problem_;
  const MeasurementBatch& all_;  // including the outliers
  const Surrogates& surrogates_;
  std::vector<Cause> causes_;
  double limit_;  // nat: the line of a finding
  Beside beside_;
  Background all_columns_;
  Estimated estimated_;
  std::vector<Half> halves_;  // where more than noise is left
  Folds folds_;
  VectorXd held_out_;
  std::vector<FamilyPtr> families_;     // empty if no finding begins at a pose
  bool more_than_accidents_ = false;    // are out
  bool several_beyond_others_ = false;  // poses that are out stand beyond all others
};

std::vector<Cause> causes_of(const std::vector<Accepted>& accepted) {
  std::vector<Cause> causes;
  for (const Accepted& one : accepted) causes.push_back(one.cause);
  return causes;
}

/// The halves of the poses: every second block of them, and the remaining blocks.
std::vector<Half> halves_of(const LinearProblem& problem, const MatrixXd& columns) {
  const Index block = std::max<Index>(1, problem.poses() / kBlocksOfHalves);
  std::vector<Half> halves;
  for (const Index half : {0, 1}) {
    std::vector<Index> rows;
    for (Index i = 0; i < problem.poses(); ++i) {
      if ((i / block) % 2 != half) continue;
      for (Index row = problem.first_row(i); row < problem.first_row(i + 1); ++row)
        rows.push_back(row);
    }
    Background background(columns(rows, Eigen::all));
    halves.push_back({std::move(rows), std::move(background)});
  }
  return halves;
}

bool begins(const Accepted& one) { return !one.is_outlier() && !one.cause.pose_id.empty(); }

Findings::Findings(const SearchResult& found, const LinearProblem& problem,
                   const Unexplained& unexplained, const Surrogates& surrogates,
                   const MeasurementBatch& recorded, const Remainder& remainder)
    : problem_(problem),
      all_(found.all),
      surrogates_(surrogates),
      causes_(causes_of(found.accepted)),
      limit_(found.chance.limit),
      beside_{causes_,       unexplained,     surrogates, recorded, remainder.more_than_noise,
              remainder.rms, remainder.larger},
      all_columns_(background_columns(problem, found.unnamed)),
      estimated_{all_columns_.estimate(problem.residual()), all_columns_.covariance()},
      halves_(remainder.more_than_noise ? halves_of(problem, all_columns_.columns())
                                        : std::vector<Half>()),
      folds_(problem, all_columns_.columns()),
      held_out_(folds_.held_out_residual(problem.residual())) {
  if (std::any_of(found.accepted.begin(), found.accepted.end(), begins))
    families_ = make_families(problem);
  more_than_accidents_ =
      std::count_if(found.accepted.begin(), found.accepted.end(),
                    [](const Accepted& one) { return one.is_outlier(); }) > kMostAccidents;
  several_beyond_others_ =
      std::count_if(found.accepted.begin(), found.accepted.end(), [this](const Accepted& one) {
        return one.is_outlier() && is_beyond_others(one);
      }) > 1;
}

Finding Findings::outlier(const Accepted& one) const {
  const ErrorFigures held_out = figures_of(problem_.positions(held_out_));
  std::vector<Cause> could_also_be;
  if (may_show_what_lacks(one)) could_also_be.push_back(unknown_cause());
  std::string action = could_also_be.empty() ? action_for(one.cause, {})
                                             : "measure it again, and more poses near it: what the "
                                               "simulation lacks may be largest there";
  return {.cause = one.cause,
          .parameters = {{"distance", "mm", to_mm(one.pose.distance),
                          to_mm(kExpanded * problem_.noise())}},
          .effect_rms = one.pose.distance,
          .held_out_before = held_out,
          .held_out_after = held_out,
          .strength = one.best.strength,
          .p_value = one.p_value,
          .could_also_be = std::move(could_also_be),
          .action = std::move(action)};
}

bool Findings::may_show_what_lacks(const Accepted& one) const {
  if (several_beyond_others_ && is_beyond_others(one)) return true;
  return beside_.more_than_noise && (more_than_accidents_ || is_beyond_others(one) ||
                                     one.pose.distance < thresholds::kFarOut * beside_.left);
}

/// True if the pose lies beyond all others in some quantity, so that no other pose shows the arm's
/// error there.
bool Findings::is_beyond_others(const Accepted& one) const {
  const auto& all = all_.measurements;
  const auto out = std::find_if(all.begin(), all.end(),
                                [&](const Measurement& m) { return m.row == one.pose.row; });
  if (out == all.end()) return false;
  VectorXd low = posture_of(problem_.model(), problem_.batch().measurements.front().context);
  VectorXd high = low;
  for (const Measurement& m : problem_.batch().measurements) {
    const VectorXd posture = posture_of(problem_.model(), m.context);
    low = low.cwiseMin(posture);
    high = high.cwiseMax(posture);
  }
  const VectorXd margin = thresholds::kBeyondOthers * (high - low);
  const VectorXd posture = posture_of(problem_.model(), out->context);
  return ((posture - high - margin).array() > 0).any() ||
         ((low - margin - posture).array() > 0).any();
}

Cause Findings::named(const Accepted& one) const {
  Cause cause = one.cause;
  if (others_speak(problem_, one, estimated_)) cause.parameter.clear();
  return cause;
}

Finding Findings::cause(const Accepted& one) const {
  Cause cause = named(one);
  std::vector<Estimate> parameters = parameters_of(problem_, one.in_model, cause, estimated_);
  if (cause.order && !parameters.empty()) cause.order = parameters.front().value;
  if (has_made_up_numbers(surrogates_, cause)) parameters.clear();
  const std::vector<Index> others =
      all_but(all_columns_.columns().cols(), places_of_source(problem_.model(), one.in_model));
  const VectorXd effect = effect_of_source(problem_, one.in_model);
  const Background rest = all_columns_.part(others);
  const double effect_rms = problem_.position_rms(rest.project(effect));
  const VectorXd without = folds_.held_out_residual(problem_.residual() + effect, others);
  const ErrorFigures before = figures_of(problem_.positions(without));
  const ErrorFigures after = figures_of(problem_.positions(held_out_));
  const OwnEstimate own =
      own_estimate(problem_, one.in_model, estimated_.change, estimated_.covariance);
  const Evidence evidence{effect_rms,
                          !beside_.more_than_noise || is_in_both_halves(one, effect, others),
                          held_out_.squaredNorm() < without.squaredNorm(),
                          is_unlikely(one.cause, own.size),
                          static_cast<int>(own.size.size()),
                          changes_size(one, effect)};
  Judgement judgement = judge(one.cause, evidence, one.could_also_be, beside_);
  return {.cause = cause,
          .source = one.source,
          .parameters = std::move(parameters),
          .may_begin_at = beginnings(one, effect, rest),
          .effect_rms = effect_rms,
          .held_out_before = before,
          .held_out_after = after,
          .held_out_gain = before.rms - after.rms,
          .strength = own.strength(),
          .p_value = one.p_value,
          .naming_frequency = one.naming_frequency,
          .could_also_be = std::move(judgement.could_also_be),
          .whole = judgement.whole,
          .action = std::move(judgement.action)};
}

bool Findings::is_in_both_halves(const Accepted& one, const VectorXd& effect,
                                 const std::vector<Index>& others) const {
  const std::vector<Index> own = places_of_source(problem_.model(), one.in_model);
  const VectorXd data = problem_.residual() + effect;
  for (const Half& half : halves_) {
    const Background rest = half.columns.part(others);
    const MatrixXd C = half.columns.columns()(Eigen::all, own);
    MatrixXd information = transposed_product(C, rest.project(C));
    information.diagonal().array() += 1;
    const VectorXd along =
        inverse_factor_of(information) * (C.transpose() * rest.project(data(half.rows)));
    const double freedom = std::min<double>(one.best.freedom, static_cast<double>(own.size()));
    if (log_evidence(along.squaredNorm(), freedom) - one.penalty < limit_) return false;
  }
  return true;
}

bool Findings::changes_size(const Accepted& one, const VectorXd& effect) const {
  const CauseRecord& record = record_of(one.cause);
  if (record.lasting != causes::Lasting::kAlways || record.scope != causes::Scope::kJoint)
    return false;
  const auto& poses = problem_.batch().measurements;
  VectorXd time = VectorXd::LinSpaced(problem_.poses(), -1, 1);
  VectorXd temperature = VectorXd::Zero(problem_.poses());
  for (Index i = 0; i < problem_.poses() && !surrogates_.temperature; ++i)
    temperature(i) = poses[static_cast<std::size_t>(i)].context.temperature.value_or(0);
  const VectorXd left = all_columns_.project(problem_.residual());
  const auto evidence_of = [&](VectorXd course) {
    course.array() -= course.mean();
    if (!(course.norm() > 0)) return 0.0;
    VectorXd more = effect;
    for (Index i = 0; i < problem_.poses(); ++i)
      more.segment(problem_.first_row(i), problem_.row_count(i)) *=
          course(i) / course.cwiseAbs().maxCoeff();
    const double own = more.dot(VectorXd(all_columns_.project(more)));
    return own > 0 ? log_evidence(std::pow(more.dot(left), 2) / own, 1) : 0;
  };
  return std::max(evidence_of(time), evidence_of(temperature)) > thresholds::kChangesSize;
}

const Family* Findings::step_family(const Accepted& one) const {
  const auto family = std::find_if(families_.begin(), families_.end(), [&](const FamilyPtr& other) {
    const Cause cause = other->cause(other->typical());
    return other->predicts() && !cause.pose_id.empty() && cause.cause == one.cause.cause &&
           cause.joint == one.cause.joint;
  });
  return one.cause.pose_id.empty() || family == families_.end() ? nullptr : family->get();
}

std::vector<PossibleBeginning> Findings::beginnings(const Accepted& one, const VectorXd& effect,
                                                    const Background& rest) const {
  const Family* family = step_family(one);
  const auto& poses = problem_.batch().measurements;
  const auto found = std::find_if(poses.begin(), poses.end(), [&](const Measurement& m) {
    return m.pose_id == one.cause.pose_id;
  });
  if (family == nullptr || found == poses.end()) return {};
  const MatrixXd always = family->columns({.pose = 0});
  std::vector<PossibleBeginning> beginnings;
  for (const Index i : possible_beginnings(problem_, always, rest, problem_.residual() + effect,
                                           found - poses.begin())) {
    const Measurement& m = poses[static_cast<std::size_t>(i)];
    beginnings.push_back({m.pose_id, m.row, surrogates_.time ? std::nullopt : m.context.time});
  }
  return beginnings;
}

}  // namespace

std::vector<Finding> findings_of(const SearchResult& found, const LinearProblem& problem,
                                 const Unexplained& unexplained, const Surrogates& surrogates,
                                 const MeasurementBatch& recorded, const Remainder& remainder) {
  const Findings findings(found, problem, unexplained, surrogates, recorded, remainder);
  std::vector<Finding> all;
  for (const Accepted& one : found.accepted) all.push_back(findings.of(one));
  return all;
}

HeldOut held_out_of(const LinearProblem& before, const LinearProblem& after) {
  const auto of = [](const LinearProblem& problem, const MatrixXd& columns) {
    return figures_of(
        problem.positions(Folds(problem, columns).held_out_residual(problem.residual())));
  };
  return {of(before, before.nuisance()), of(after, after.nuisance())};
}

}  // namespace trammel::cause_search
