#include "server/diagnose/search/naming.h"

#include <algorithm>
#include <string>

#include "server/diagnose/families/candidates.h"
#include "server/diagnose/thresholds.h"
#include "server/measurement/one_place.h"

namespace trammel::cause_search {

namespace {

using causes::Likeness;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitions = 100;  // of the batch: a share of 90 % is known to 3 %

bool no_rival(const Cause& named, const Cause& other) {
  return is_description_of(other, named) || is_whole_of(named, other);
}

/// True for a step so near the first pose that it means an effect that always acted.
bool begins_at_once(const Cause& cause, const Best& best, Index poses) {
  return !cause.pose_id.empty() &&
         static_cast<double>(best.pose) < thresholds::kAtOnce * static_cast<double>(poses);
}

VectorXd fitted(const Background& background, const MatrixXd& columns, const VectorXd& data) {
  const MatrixXd information = columns.transpose() * background.project(columns) +
                               MatrixXd::Identity(columns.cols(), columns.cols());
  return columns * information.llt().solve(columns.transpose() * background.project(data));
}

/// True if `rival`, from the record of `own`, means `other`. A rival with a joint must be at the
/// same joint, and its number must agree. With `or_whole`, the whole cause counts for any of its
/// numbers.
bool means(const causes::Rival& rival, const Cause& own, const Cause& other, bool or_whole) {
  if (other.cause != rival.cause) return false;
  if (record_of(other).scope == causes::Scope::kJoint && other.joint != own.joint) return false;
  if (rival.parameter.empty() || (or_whole && other.parameter.empty())) return true;
  return other.parameter == parameter_of(rival, own.joint);
}

bool has_rival(const Cause& own, const Cause& other, std::initializer_list<Likeness> likenesses,
               bool or_whole) {
  const std::vector<causes::Rival>& rivals = record_of(own).rivals;
  return std::any_of(rivals.begin(), rivals.end(), [&](const causes::Rival& rival) {
    return std::find(likenesses.begin(), likenesses.end(), rival.likeness) != likenesses.end() &&
           means(rival, own, other, or_whole);
  });
}

/// True if two numbers of this cause count as two causes.
bool numbers_are_causes(const CauseRecord& record) {
  return record.numbers == causes::Numbers::kApart || record.numbers == causes::Numbers::kOneAJoint;
}

}  // namespace

bool is_whole_of(const Cause& whole, const Cause& step) {
  return has_rival(step, whole, {Likeness::kFromTheFirstPose}, true);
}

causes::Part part_of(const Cause& cause) {
  const CauseRecord& record = record_of(cause);
  const causes::Rival* whole = whole_of(record);
  return whole == nullptr ? record.part : cause_spelled(whole->cause).part;
}

bool is_description_of(const Cause& general, const Cause& special) {
  if (general.cause == special.cause) {
    if (numbers_are_causes(record_of(general)) && !general.parameter.empty() &&
        !special.parameter.empty())
      return general.parameter == special.parameter;
    return general.joint == special.joint || general.joint < 0 || special.joint < 0;
  }
  return has_rival(general, special,
                   {Likeness::kSpecialCase, Likeness::kSimplerCase, Likeness::kDoubtfulCase},
                   false);
}

bool is_simpler_case(const Cause& simple, const Cause& general) {
  return has_rival(general, simple, {Likeness::kSimplerCase}, false);
}

bool is_doubtful_case(const Cause& general, const Cause& special) {
  return has_rival(general, special, {Likeness::kDoubtfulCase}, false);
}

namespace {

/// Where link errors leave the tool in place, base and tool compensate for each other, and links
/// for both.
std::vector<Cause> rivals_at_one_point(const Cause& cause) {
  std::vector<Cause> rivals;
  if (record_of(cause).part != causes::Part::kLinks) return rivals;
  for (const causes::Part part : {causes::Part::kBase, causes::Part::kTool})
    rivals.push_back(cause_at(cause_correcting(part)));
  return rivals;
}

}  // namespace

std::vector<Cause> untestable_rivals(const Cause& cause, const MeasurementBatch& batch) {
  const auto recorded = [&](auto has) {
    return std::all_of(batch.measurements.begin(), batch.measurements.end(),
                       [&](const Measurement& m) { return has(m.context); });
  };
  const bool times = recorded([](const PoseContext& c) { return c.time.has_value(); });
  const bool temperatures =
      recorded([](const PoseContext& c) { return c.temperature.has_value(); });
  const auto lacks = [&](const ContextNeeds& needs) {
    return (needs.time && !times) || (needs.temperature && !temperatures);
  };
  const CauseRecord& own = record_of(cause);
  std::vector<Cause> rivals =
      is_each_tool_at_one_place(batch) ? rivals_at_one_point(cause) : std::vector<Cause>();
  for (const CauseRecord* other : all_causes()) {
    if (own.goes_with_time && other->goes_with_time && other != &own && lacks(other->needs))
      rivals.push_back(cause_at(*other));
  }
  // Along a path a lag changes smoothly, so it looks like an effect of a joint, or like a change
  // that began on the way.
  if (!is_path_without_times(batch) || own.search == causes::SearchFamily::kPose) return rivals;
  for (const CauseRecord* other : all_causes()) {
    if (other->needs.velocity) rivals.push_back(cause_at(*other));
  }
  return rivals;
}

namespace {

/// The cause at `place` of a scan, and how its effect as fitted looks to all the others.
class Doubt {
 public:
  Doubt(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
        const Background& background, const Scan& seen, std::size_t place)
      : problem_(problem),
        families_(families),
        background_(background),
        seen_(seen),
        place_(place),
        effect_(fitted(background, families[place]->columns(seen.best[place]), problem.residual())),
        projected_(background.project(effect_)),
        view_{background},
        whole_(effect_.dot(projected_.col(0))) {}

  /// Repeats the batch in simulation, with the effect as it was fitted.
  void repeat(const Chance& chance, std::uint64_t seed) {
    repeated_ = winners(families_, background_,
                        draw_null(background_, kRepetitions, seed).colwise() + effect_, chance,
                        [&](std::size_t f) { return contends(f); });
  }
  /// The share of the repetitions with this name, or with the name of a cause that is not its
  /// rival.
  [[nodiscard]] double frequency() const {
    double sum = 0;
    for (std::size_t f = 0; f < families_.size(); ++f) {
      if (families_[f]->named() &&
          (f == place_ || no_rival(cause(), families_[f]->cause(seen_.best[f]))))
        sum += share_of(f);
    }
    return sum;
  }
  /// True if the cause at `f` explains the data as well. `frequency`: as above.
  [[nodiscard]] bool is_rival(std::size_t f, double frequency) const;

 private:
  [[nodiscard]] Cause cause() const { return families_[place_]->cause(seen_.best[place_]); }
  /// A cause that explains nothing of the data cannot win their repetitions.
  [[nodiscard]] bool contends(std::size_t f) const {
    return seen_.score[f] > thresholds::kNamingContender * seen_.score[place_];
  }
  [[nodiscard]] double share_of(std::size_t f) const {
    return static_cast<double>(
               std::count(repeated_.family.begin(), repeated_.family.end(), static_cast<int>(f))) /
           static_cast<double>(repeated_.family.size());
  }
  /// Repetitions show how often such data decide; these data may have decided already.
  [[nodiscard]] bool is_decided(std::size_t f, double frequency) const {
    const double margin =
        frequency < thresholds::kSureFrequency ? thresholds::kDecidedUnsure : thresholds::kDecided;
    return gap(f) > std::max(margin, thresholds::kShapeError * seen_.best[place_].strength);
  }
  /// nat.
  [[nodiscard]] double gap(std::size_t f) const { return seen_.score[place_] - seen_.score[f]; }
  [[nodiscard]] bool is_as_good(std::size_t f, double made) const;

  const LinearProblem& problem_;
  const std::vector<FamilyPtr>& families_;
  const Background& background_;
  const Scan& seen_;
  std::size_t place_;
  VectorXd effect_;
  MatrixXd projected_;
  View view_;     // of the projected effect
  double whole_;  // strength of the effect
  Winners repeated_;
};

bool Doubt::is_rival(std::size_t f, double frequency) const {
  if (f == place_ || !families_[f]->named() || !families_[f]->predicts() || !contends(f))
    return false;
  const Cause other = families_[f]->cause(seen_.best[f]);
  const bool decided = is_decided(f, frequency);
  // If a more general description is equally likely, the special one is not certain.
  const bool only_describes =
      no_rival(cause(), other) && (decided || !is_doubtful_case(other, cause()));
  if (only_describes || begins_at_once(other, seen_.best[f], problem_.poses())) return false;
  const double made = families_[f]->scan(view_, projected_).front().strength;
  if (is_as_good(f, made)) return true;
  // Another cause may exist as well; it is a rival only if it explains much of this effect.
  const bool related = made > thresholds::kRelatedShare * whole_;
  const bool wins = frequency < thresholds::kSureFrequency &&
                    share_of(f) > thresholds::kRivalFrequency &&
                    made > thresholds::kCoincidenceShare * whole_;
  return !decided && (related || wins);
}

/// True if the cause at `f`, which explains the share `made` of the effect's strength, has the same
/// effect on the poses and explains the data nearly as well.
bool Doubt::is_as_good(std::size_t f, double made) const {
  const Best& best = seen_.best[place_];
  const double lacks =
      (best.strength - best.freedom) - (seen_.best[f].strength - seen_.best[f].freedom);
  return made > thresholds::kSameShare * whole_ &&
         lacks < std::max(thresholds::kAsGoodStrength, thresholds::kShapeError * best.strength) &&
         (made > thresholds::kWholeShare * whole_ || gap(f) < thresholds::kMoreNumbers);
}

}  // namespace

Naming name_or_doubt(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                     const Background& background, const Scan& seen, const Chance& chance,
                     std::size_t place, std::uint64_t seed) {
  Doubt doubt(problem, families, background, seen, place);
  doubt.repeat(chance, seed);
  Naming naming{doubt.frequency(), {}};
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (doubt.is_rival(f, naming.frequency))
      naming.could_also_be.push_back(families[f]->cause(seen.best[f]));
  }
  for (const Cause& rival :
       untestable_rivals(families[place]->cause(seen.best[place]), problem.batch())) {
    add(naming.could_also_be, rival);
  }
  return naming;
}

}  // namespace trammel::cause_search
