#include "server/diagnose/search/naming.h"

#include <algorithm>

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitions = 100;
constexpr double kSureFrequency = 0.9;
constexpr double kRivalFrequency = 0.03;
constexpr double kMargin = 1.5;         // nat: odds of 4.5 to 1
constexpr double kSafeMargin = 2.5;     // nat: odds of 12 to 1
constexpr double kSameEffect = 0.9025;  // square of the canonical correlation 0.95
constexpr double kRelated = 0.4;        // the same of 0.63
constexpr double kTouches = 0.1;        // less is a coincidence
constexpr double kAsGood = 6;           // of strength
constexpr double kBeyondDoubt = 8;      // nat: nearly the same effect, from so many more numbers, is no accident
constexpr double kAllOfIt = 0.995;      // the same of 0.9975: no strength of the effect tells them apart
constexpr double kContender = 0.15;     // of the best score
constexpr double kPathStep = 0.2;       // rad
constexpr double kAtOnce = 0.05;        // of the poses
constexpr double kShapeError = 0.02;    // of strength: real causes are not quite shaped like their models

bool no_rival(const Cause& named, const Cause& other) {
  return is_description_of(other, named) || is_whole_of(named, other);
}

/// A step so near to the first pose that it stands for something that always acted.
bool begins_at_once(const Cause& cause, const Best& best, Index poses) {
  return !cause.pose_id.empty() && best.at < kAtOnce * static_cast<double>(poses);
}

VectorXd fitted(const Background& background, const MatrixXd& columns, const VectorXd& data) {
  const MatrixXd information =
      columns.transpose() * background.project(columns) + MatrixXd::Identity(columns.cols(), columns.cols());
  return columns * information.llt().solve(columns.transpose() * background.project(data));
}

}  // namespace

namespace {

using causes::Likeness;

/// Whether `rival`, as the record of `own` has it, means `other`: of the same joint where it is of one, and the number
/// that it names. `or_whole`: the cause as a whole counts for its number.
bool means(const causes::Rival& rival, const Cause& own, const Cause& other, bool or_whole) {
  if (other.cause != rival.cause) return false;
  if (record_of(other).scope == causes::Scope::kJoint && other.joint != own.joint) return false;
  if (rival.parameter.empty() || (or_whole && other.parameter.empty())) return true;
  return other.parameter == parameter_of(rival, own.joint);
}

bool has_rival(const Cause& own, const Cause& other, std::initializer_list<Likeness> likenesses, bool or_whole) {
  const std::vector<causes::Rival>& rivals = record_of(own).rivals;
  return std::any_of(rivals.begin(), rivals.end(), [&](const causes::Rival& rival) {
    return std::find(likenesses.begin(), likenesses.end(), rival.likeness) != likenesses.end() &&
           means(rival, own, other, or_whole);
  });
}

/// Whether two numbers of this cause are two causes.
bool numbers_are_causes(const CauseRecord& record) {
  return record.numbers == causes::Numbers::kApart || record.numbers == causes::Numbers::kOneAJoint;
}

/// A special case that is not sure where the general one is as likely.
bool is_doubtful_case(const Cause& general, const Cause& special) {
  return has_rival(general, special, {Likeness::kDoubtfulCase}, false);
}

}  // namespace

bool is_whole_of(const Cause& whole, const Cause& step) {
  return has_rival(step, whole, {Likeness::kFromTheFirstPose}, true);
}

bool is_description_of(const Cause& general, const Cause& special) {
  if (general.cause == special.cause) {
    if (numbers_are_causes(record_of(general)) && !general.parameter.empty() && !special.parameter.empty())
      return general.parameter == special.parameter;
    return general.joint == special.joint || general.joint < 0 || special.joint < 0;
  }
  return has_rival(general, special, {Likeness::kSpecialCase, Likeness::kSimplerCase, Likeness::kDoubtfulCase}, false);
}

bool is_simpler_case(const Cause& simple, const Cause& general) {
  return has_rival(general, simple, {Likeness::kSimplerCase}, false);
}

namespace {

/// Poses that follow one another closely: measured in motion, as it seems.
bool is_path(const MeasurementBatch& batch) {
  for (std::size_t i = 1; i < batch.measurements.size(); ++i) {
    const JointVector step = batch.measurements[i].context.q - batch.measurements[i - 1].context.q;
    if (step.cwiseAbs().maxCoeff() > kPathStep) return false;
  }
  return true;
}

}  // namespace

std::vector<Cause> untestable_rivals(const Cause& cause, const MeasurementBatch& batch) {
  const auto recorded = [&](auto has) {
    return std::all_of(batch.measurements.begin(), batch.measurements.end(),
                       [&](const Measurement& m) { return has(m.context); });
  };
  const bool times = recorded([](const PoseContext& c) { return c.time.has_value(); });
  const bool temperatures = recorded([](const PoseContext& c) { return c.temperature.has_value(); });
  const auto lacks = [&](const ContextNeeds& needs) {
    return (needs.time && !times) || (needs.temperature && !temperatures);
  };
  const CauseRecord& own = record_of(cause);
  std::vector<Cause> rivals;
  for (const CauseRecord* other : all_causes()) {
    if (own.goes_with_time && other->goes_with_time && other != &own && lacks(other->needs))
      rivals.push_back(cause_at(*other));
  }
  // Along a path a lag goes on smoothly: it looks like what a joint does, and like what began on the way.
  const bool in_motion =
      is_path(batch) && std::none_of(batch.measurements.begin(), batch.measurements.end(),
                                     [](const Measurement& m) { return m.context.velocity.has_value(); });
  if (!in_motion || own.search == causes::SearchFamily::kPose) return rivals;
  for (const CauseRecord* other : all_causes()) {
    if (other->needs.velocity) rivals.push_back(cause_at(*other));
  }
  return rivals;
}

Naming name_or_doubt(const LinearProblem& problem, const std::vector<FamilyPtr>& families, const Background& background,
                     const Scan& seen, const Chance& chance, std::size_t place, std::uint64_t seed) {
  const Best& best = seen.best[place];
  const Cause cause = families[place]->cause(best);
  const VectorXd effect = fitted(background, families[place]->columns(best), problem.residual());
  // What explains nothing of the data cannot win their repetitions.
  const auto contends = [&](std::size_t f) { return seen.score[f] > kContender * seen.score[place]; };
  const Winners repeated =
      winners(families, background, draw_null(background, kRepetitions, seed).colwise() + effect, chance, contends);
  const auto share_of = [&](std::size_t f) {
    return static_cast<double>(std::count(repeated.family.begin(), repeated.family.end(), static_cast<int>(f))) /
           static_cast<double>(repeated.family.size());
  };
  const MatrixXd projected = background.project(effect);
  const double whole = effect.dot(projected.col(0));

  Naming naming{0, {}};
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (families[f]->named() && (f == place || no_rival(cause, families[f]->cause(seen.best[f]))))
      naming.frequency += share_of(f);
  }
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (!families[f]->named() || !families[f]->predicts() || !contends(f)) continue;
    const Cause other = families[f]->cause(seen.best[f]);
    // Repetitions tell how often such data decide; these data may have decided.
    const double margin = naming.frequency < kSureFrequency ? kSafeMargin : kMargin;
    const double gap = seen.score[place] - seen.score[f];
    const bool decided = gap > std::max(margin, kShapeError * best.strength);
    // A more general description that is as likely says that the special one is not sure.
    const bool only_describes = no_rival(cause, other) && (decided || !is_doubtful_case(other, cause));
    if (f == place || only_describes || begins_at_once(other, seen.best[f], problem.poses())) continue;
    const Best of_effect = families[f]->scan({background}, projected).front();
    const bool same_effect = of_effect.strength > kSameEffect * whole;
    const double lacks = (best.strength - best.freedom) - (seen.best[f].strength - seen.best[f].freedom);
    const bool can_do_it_all = of_effect.strength > kAllOfIt * whole;
    const bool as_good =
        same_effect && lacks < std::max(kAsGood, kShapeError * best.strength) && (can_do_it_all || gap < kBeyondDoubt);
    // Another cause may be there as well: only what makes much of this effect is a rival for it.
    const bool related = of_effect.strength > kRelated * whole;
    const bool wins =
        naming.frequency < kSureFrequency && share_of(f) > kRivalFrequency && of_effect.strength > kTouches * whole;
    if (as_good || (!decided && (related || wins))) naming.could_also_be.push_back(other);
  }
  for (const Cause& rival : untestable_rivals(cause, problem.batch())) {
    if (std::find(naming.could_also_be.begin(), naming.could_also_be.end(), rival) == naming.could_also_be.end())
      naming.could_also_be.push_back(rival);
  }
  return naming;
}

}  // namespace trammel
