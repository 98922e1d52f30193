#include "server/compensate/session_changes.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/base/coverage.h"
#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/calibrate/one_session.h"

namespace trammel {

namespace {

constexpr const char* kRestsOnOrder = "; this rests on the order in which the sessions were given";

/// The factor and the unit in which a parameter is shown.
Reading shown(const Parameter& parameter) {
  Reading reading = reading_of(parameter.unit);
  reading.scale *= parameter.scale;
  return reading;
}

/// Without the row at which it began: `slip3`.
std::string plain_name(const Parameter& parameter) {
  return parameter.name.substr(0, parameter.name.find('@'));
}

/// Places of the parameters of these sources.
std::vector<Eigen::Index> places_of(const PhysicalModel& physics,
                                    const std::vector<std::string>& sources) {
  std::vector<Eigen::Index> places;
  Eigen::Index next = 0;
  for (const ErrorSourcePtr& source : physics.sources) {
    const bool is_one = std::find(sources.begin(), sources.end(), source->name()) != sources.end();
    for (std::size_t k = 0; k < source->parameters().size(); ++k, ++next)
      if (is_one) places.push_back(next);
  }
  return places;
}

std::vector<SessionChange::Size> sizes_of(const IdentifiedTogether& found, const Change& change) {
  std::vector<SessionChange::Size> sizes;
  for (const Eigen::Index place : places_of(found.physics, {change.source})) {
    const IdentifiedParameter& one = found.parameters[static_cast<std::size_t>(place)];
    const auto [scale, unit] = shown(one.parameter);
    sizes.push_back(
        {plain_name(one.parameter), unit, scale * one.value, kExpanded * scale * one.stddev});
  }
  return sizes;
}

/// The total change of a zero: the sum of its steps.
std::vector<SessionChange::Size> sum_of_steps(const IdentifiedTogether& found,
                                              const Change& change) {
  const std::vector<Eigen::Index> places = places_of(found.physics, change.steps);
  if (places.empty()) return {};
  const Parameter& first = found.parameters[static_cast<std::size_t>(places.front())].parameter;
  const auto [scale, unit] = shown(first);
  double sum = 0;
  for (const Eigen::Index place : places)
    sum += found.parameters[static_cast<std::size_t>(place)].value;
  const double stddev = std::sqrt(std::max(0.0, found.covariance(places, places).sum()));
  return {{plain_name(first), unit, scale * sum, kExpanded * scale * stddev}};
}

std::string number_of(const SessionChange::Size& one) {
  const ShownValue read = show_read(one.value, one.u95, {1, one.unit});
  return fmt::format("{} ± {} {}", read.value, read.expanded, one.unit);
}

std::string numbers_of(const std::vector<SessionChange::Size>& sizes) {
  std::vector<std::string> numbers;
  for (const SessionChange::Size& one : sizes) numbers.push_back(one.name + " " + number_of(one));
  return fmt::format("{}", fmt::join(numbers, ", "));
}

std::string what_changed(const SessionChange& change) {
  switch (change.course) {
    case SessionChange::Course::kWanders:
      return fmt::format(
          "slow drift: {}, {:.2g} deg from session to session (a random walk); since session {} "
          "it has moved by {} (U, k=2)",
          cause_in_words(change.source), change.rate, change.session_id,
          change.sizes.empty() ? "an unknown amount" : number_of(change.sizes.front()));
    case SessionChange::Course::kThatAlone:
      return fmt::format(
          "in session {} alone (from pose {}) the reflector, or the tool that carries it, sat "
          "elsewhere ({}; U, k=2): the sessions after it are as those before",
          change.session_id, change.pose_id, numbers_of(change.sizes));
    case SessionChange::Course::kSince:
      break;
  }
  return fmt::format("since session {} (pose {}): {} ({}; U, k=2)", change.session_id,
                     change.pose_id, cause_in_words(change.source), numbers_of(change.sizes));
}

SessionChange told(const IdentifiedTogether& found, const Change& change) {
  const bool wanders = change.rate > 0;
  const SessionSetting& since = wanders ? found.sessions.front() : found.sessions[change.session];
  SessionChange one;
  one.source = change.source;
  const NamedCause named = named_cause(change.source);
  one.cause = named.cause;
  one.joint = named.joint;
  one.course = wanders                     ? SessionChange::Course::kWanders
               : is_of_one_session(change) ? SessionChange::Course::kThatAlone
                                           : SessionChange::Course::kSince;
  one.session_id = since.id;
  one.pose_id = since.first_pose;
  one.rate = to_deg(change.rate);
  one.sizes = wanders ? sum_of_steps(found, change) : sizes_of(found, change);
  one.strength = change.gain;
  one.p_value = change.p_value;
  one.could_also_be = change.could_also_be;
  one.rests_on_order = found.as_given;
  return one;
}

}  // namespace

std::vector<SessionChange> session_changes(const IdentifiedTogether& found) {
  std::vector<SessionChange> all;
  for (const Change& change : found.changes) all.push_back(told(found, change));
  return all;
}

std::vector<SessionChange> session_changes(const CompensatedModel& model) {
  const ModelParts& parts = model.parts();
  return session_changes(IdentifiedTogether{parts.physics, parts.parameters, parts.covariance,
                                            parts.sessions, parts.changes,
                                            parts.sessions_as_given});
}

std::string sentence(const SessionChange& change) {
  std::string text = what_changed(change);
  std::vector<std::string> others;
  for (const std::string& other : change.could_also_be) others.push_back(cause_in_words(other));
  if (!others.empty())
    text += fmt::format("; ambiguous: it could also be {}", fmt::join(others, " or "));
  return change.rests_on_order ? text + kRestsOnOrder : text;
}

std::optional<std::string> note_on_order(const std::vector<SessionSetting>& sessions,
                                         bool as_given) {
  if (!as_given || sessions.empty()) return std::nullopt;
  return fmt::format(
      "the sessions stand in the order in which they were given, since not all of them have "
      "absolute times: {} is taken for the newest, and what changed is dated by that order",
      sessions.back().id);
}

NamedCause named_cause(const std::string& source) {
  const std::string spelled = source.substr(0, source.find('@'));
  const std::size_t colon = spelled.find(':');
  if (colon == std::string::npos) return {spelled, std::nullopt};
  return {spelled.substr(0, colon), std::atoi(spelled.c_str() + colon + 1)};
}

std::string cause_in_words(const std::string& source) {
  return in_words(source.substr(0, source.find('@')));
}

}  // namespace trammel
