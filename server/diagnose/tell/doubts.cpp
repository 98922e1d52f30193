#include "server/diagnose/tell/doubts.h"

#include <algorithm>
#include <cmath>

#include "server/diagnose/search/naming.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"
#include "server/measurement/one_place.h"

namespace trammel::cause_search {

namespace {

constexpr Eigen::Index kNumbersOfPayload = 4;  // its mass, then its centre of gravity

bool contains(const std::vector<Cause>& causes, const Cause& cause) {
  return std::find(causes.begin(), causes.end(), cause) != causes.end();
}

bool is_dwarfed(double effect_rms, const Unexplained& unexplained) {
  return unexplained.present && effect_rms <= thresholds::kDwarfed * unexplained.rms;
}

/// The causes that describe several causes of this kind better than one by one, such as a map of
/// the joint's angle for the orders of a gear. They apply if the joint has too many of this kind to
/// be credible, or if the general cause was found beside them.
std::vector<Cause> descriptions_of_many(const Cause& cause, const std::vector<Cause>& found) {
  const auto at_joint = [&](std::string_view name) {
    return std::count_if(found.begin(), found.end(), [&](const Cause& other) {
      return other.cause == name && other.joint == cause.joint;
    });
  };
  const bool too_many = at_joint(cause.cause) > thresholds::kMostOrders;
  std::vector<Cause> all;
  for (const CauseRecord* record : all_causes()) {
    const Cause general = cause_at(*record, cause.joint);
    if (is_doubtful_case(general, cause) && (too_many || at_joint(general.cause) > 0))
      all.push_back(general);
  }
  return all;
}

/// True if the residual is larger than stated, but not so large that it is unknown: the name may be
/// a part of the rest.
bool is_a_little_more(const Beside& beside) { return beside.larger && !beside.more_than_noise; }

/// True if a cause of one joint has so many numbers that it fits parts of many other effects.
bool is_flexible(const Cause& cause, const Evidence& evidence) {
  const CauseRecord& record = record_of(cause);
  return record.scope == causes::Scope::kJoint && record.search == causes::SearchFamily::kColumns &&
         evidence.numbers > thresholds::kManyNumbers;
}

bool begins_at_a_pose(const Cause& cause) {
  return !cause.pose_id.empty() && record_of(cause).lasting == causes::Lasting::kFromAPose;
}

/// True if the cause begins at more than one pose.
bool begins_again(const Cause& cause, const std::vector<Cause>& found) {
  return begins_at_a_pose(cause) &&
         std::count_if(found.begin(), found.end(), [&](const Cause& other) {
           return other.cause == cause.cause && other.joint == cause.joint;
         }) > 1;
}

bool goes_with_time(const Unexplained& unexplained) {
  const auto& on = unexplained.depends_on;
  return std::any_of(on.begin(), on.end(),
                     [](const auto& one) { return one == "time" || one == "temperature"; });
}

/// True if lengths that change with the temperature may be the instrument's own. Its scale also
/// moves the base, about the instrument, so another effect must move during the batch.
bool may_be_scale(const Cause& cause, const Beside& beside) {
  const CauseRecord& own = record_of(cause);
  if (own.acts.on != causes::ActsOn::kLinks || !own.needs.temperature) return false;
  return goes_with_time(beside.unexplained) ||
         std::any_of(beside.found.begin(), beside.found.end(), [](const Cause& other) {
           const CauseRecord& record = record_of(other);
           return record.scope == causes::Scope::kSession && !record.needs.velocity;
         });
}

/// Adds causes that depend on time alone.
void add_going_with_time(std::vector<Cause>& rivals) {
  for (const CauseRecord* record : all_causes()) {
    if (record->goes_with_time && record->needs.time) add(rivals, cause_at(*record));
  }
}

/// Adds the alternatives to a cause that was found by a substitute quantity. Such a cause is never
/// certain.
void add_rivals_of_surrogate(const Cause& cause, std::vector<Cause>& rivals) {
  const ContextNeeds& needs = record_of(cause).needs;
  if (needs.direction) return add(rivals, unknown_cause(cause.joint));
  if (needs.temperature) add_going_with_time(rivals);
  if (rivals.empty()) rivals.push_back(unknown_cause());
}

/// Adds causes that load the joints as a payload does.
void add_what_weighs(std::vector<Cause>& rivals) {
  for (const CauseRecord* record : all_causes()) {
    if (record->acts.on == causes::ActsOn::kLoad && record->search == causes::SearchFamily::kNone)
      add(rivals, cause_at(*record));
  }
}

std::string what_to_record(const Cause& cause, const Surrogates& surrogates) {
  if (record_of(cause).needs.direction)
    return "needs the approach direction of each pose (dir columns): it was taken from the order "
           "of the rows";
  return fmt::format(
      "record {} with every pose, and measure reference reflectors in between: what was not "
      "recorded was taken from the order of the rows",
      !surrogates.temperature ? "the time (time_s)"
      : surrogates.time       ? "temperature and time (temperature_c, time_s)"
                              : "the temperature (temperature_c)");
}

}  // namespace

bool is_unlikely(const Cause& cause, const Eigen::VectorXd& size) {
  const CauseRecord& record = record_of(cause);
  if (record.lasting != causes::Lasting::kAlways || size.size() == 0) return false;
  if (record.summary == causes::Summary::kAmplitude)
    return size.norm() > thresholds::kUnlikelyEccentricity;
  if (record.part != causes::Part::kPayload) return false;
  double farthest = 0;  // of a centre of gravity; a mass may be anything
  for (Eigen::Index k = 0; k < size.size(); ++k) {
    if (k % kNumbersOfPayload != 0) farthest = std::max(farthest, std::abs(size(k)));
  }
  return farthest > thresholds::kUnlikelyPayload;
}

bool differ_in_form_only(const Cause& cause, const std::vector<Cause>& others) {
  return std::all_of(others.begin(), others.end(), [&](const Cause& other) {
    return (other.cause == cause.cause && other.joint == cause.joint) ||
           is_description_of(other, cause);
  });
}

namespace {

/// The reasons for which a cause is doubted.
struct Doubts {
  bool by_surrogate, dwarfed, again, unlikely, slow, by_scale, not_held_out, by_half, changes,
      is_part, by_many_numbers, at_one_point;
  std::vector<Cause> many;

  Doubts(const Cause& cause, const Evidence& evidence, const std::vector<Cause>& rivals,
         const Beside& beside)
      : by_surrogate(is_by_surrogate(beside.surrogates, cause)),
        dwarfed(is_dwarfed(evidence.effect_rms, beside.unexplained)),
        again(begins_again(cause, beside.found)),
        unlikely(evidence.unlikely),
        slow(begins_at_a_pose(cause) && goes_with_time(beside.unexplained)),
        by_scale(may_be_scale(cause, beside)),
        not_held_out(!evidence.helps_held_out),
        by_half(beside.more_than_noise && !evidence.in_both_halves),
        changes(evidence.changes),
        is_part(is_a_little_more(beside) && evidence.effect_rms <= beside.left),
        by_many_numbers(is_a_little_more(beside) && is_flexible(cause, evidence)),
        at_one_point(record_of(cause).part == causes::Part::kLinks &&
                     is_each_tool_at_one_place(beside.recorded)),
        many(descriptions_of_many(cause, beside.found)) {
    std::erase_if(many, [&](const Cause& general) { return contains(rivals, general); });
  }
  [[nodiscard]] std::vector<Cause> could_also_be(const Cause& cause,
                                                 const std::vector<Cause>& rivals,
                                                 const Beside& beside) const;
  /// The action about the last of them; empty where there is none.
  [[nodiscard]] std::string action(const Cause& cause, const Surrogates& surrogates) const;
};

std::vector<Cause> Doubts::could_also_be(const Cause& cause, const std::vector<Cause>& rivals,
                                         const Beside& beside) const {
  std::vector<Cause> all = rivals;
  for (const Cause& rival : untestable_rivals(cause, beside.recorded)) add(all, rival);
  if (by_surrogate) add_rivals_of_surrogate(cause, all);
  if (dwarfed || by_scale) add(all, unknown_cause());
  all.insert(all.end(), many.begin(), many.end());
  if (again || slow) add(all, unknown_cause(cause.joint));
  if (unlikely) add_what_weighs(all);
  if (not_held_out || by_half || changes || is_part || by_many_numbers)
    add(all, unknown_cause(cause.joint));
  return all;
}

std::string Doubts::action(const Cause& cause, const Surrogates& surrogates) const {
  if (!many.empty())
    return fmt::format(
        "measure more poses over the range of joint {}: its error has no single order",
        cause.joint + 1);
  if (dwarfed) return "find first what is unknown here: it is several times larger";
  if (again)
    return "it changes more than once, as something that moves slowly does: " +
           what_slow_changes_need(surrogates);
  if (slow)
    return "something moves slowly as well, of which it may be part: " +
           what_slow_changes_need(surrogates);
  if (unlikely)
    return "it is larger than robots have it: measure with another known payload, which the arm's "
           "own weight does not follow";
  if (by_scale)
    return "it may be the scale of the instrument, which follows the temperature of the air: see "
           "that its weather station is right, and measure reference reflectors at known distances "
           "in between";
  if (at_one_point)
    return "measure poses at other places of the workspace, too: about one point base, tool and "
           "links make up for each other";
  if (by_half)
    return "measure again with other poses: half of these do not show it by themselves, and more "
           "than noise is left";
  if (not_held_out)
    return "measure again with other poses: those that are held out are not predicted better with "
           "it";
  if (changes)
    return "its size changed while the batch was measured, as that of this cause does not: " +
           what_slow_changes_need(surrogates);
  if (is_part)
    return "find first what is unknown here: more is left beyond the stated noise than this";
  if (by_many_numbers)
    return "measure more poses: a cause of so many numbers fits a part of many others, and what is "
           "left is larger than the stated noise";
  return by_surrogate ? what_to_record(cause, surrogates) : "";
}

}  // namespace

Judgement judge(const Cause& cause, const Evidence& evidence, const std::vector<Cause>& rivals,
                const Beside& beside) {
  const Doubts doubts(cause, evidence, rivals, beside);
  std::vector<Cause> could_also_be = doubts.could_also_be(cause, rivals, beside);
  const bool whole = !beside.more_than_noise || !differ_in_form_only(cause, could_also_be);
  const Cause unknown = unknown_cause(cause.joint);
  if (beside.more_than_noise && !contains(could_also_be, unknown_cause()))
    add(could_also_be, unknown);
  std::string action = doubts.action(cause, beside.surrogates);
  if (action.empty()) {
    action = !whole && evidence.effect_rms <= beside.left
                 ? "find first what is unknown here: more is left than this"
                 : action_for(cause, rivals);
  }
  return {std::move(could_also_be), whole, std::move(action)};
}

}  // namespace trammel::cause_search
