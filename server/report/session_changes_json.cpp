#include "server/report/session_changes_json.h"

#include "server/base/shown_value.h"
#include "server/report/html.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

const char* to_text(SessionChange::Course course) {
  switch (course) {
    case SessionChange::Course::kThatAlone:
      return "that_session_alone";
    case SessionChange::Course::kWanders:
      return "wanders";
    case SessionChange::Course::kSince:
      break;
  }
  return "since";
}

ordered_json cause_json(const NamedCause& named) {
  ordered_json json = {{"cause", named.cause}};
  json["joint"] = named.joint ? ordered_json(*named.joint) : ordered_json(nullptr);
  return json;
}

ordered_json change_json(const SessionChange& change) {
  ordered_json json = cause_json({change.cause, change.joint});
  json["since"] = {{"session_id", change.session_id}, {"pose_id", change.pose_id}};
  json["course"] = to_text(change.course);
  json["source"] = change.source;
  json["parameters"] = ordered_json::object();
  for (const SessionChange::Size& one : change.sizes)
    json["parameters"][one.name] = {{"value", one.value}, {"u95", one.u95}, {"unit", one.unit}};
  if (change.course == SessionChange::Course::kWanders)
    json["wanders_deg_per_session"] = change.rate;
  json["strength"] = change.strength;
  json["p_value"] = change.p_value;
  json["could_also_be"] = ordered_json::array();
  for (const std::string& other : change.could_also_be)
    json["could_also_be"].push_back(cause_json(named_cause(other)));
  json["rests_on_order"] = change.rests_on_order;
  json["sentence"] = sentence(change);
  return json;
}

std::string since_words(const SessionChange& change) {
  const char* words =
      change.course == SessionChange::Course::kThatAlone ? "{} alone (pose {})" : "{} (pose {})";
  return fmt::format(fmt::runtime(words), html_text(change.session_id), html_text(change.pose_id));
}

std::string others_words(const SessionChange& change) {
  std::vector<std::string> words;
  for (const std::string& other : change.could_also_be)
    words.push_back(html_text(cause_in_words(other)));
  if (change.course == SessionChange::Course::kWanders)
    words.push_back(fmt::format("wanders, {:.2g} deg a session", change.rate));
  return fmt::format("{}", fmt::join(words, ", or "));
}

}  // namespace

ordered_json session_changes_json(const std::vector<SessionChange>& changes) {
  ordered_json list = ordered_json::array();
  for (const SessionChange& change : changes) list.push_back(change_json(change));
  return list;
}

std::string session_changes_html(const std::vector<SessionChange>& changes) {
  if (changes.empty()) return "";
  std::vector<HtmlRow> rows;
  for (const SessionChange& change : changes) {
    for (const SessionChange::Size& one : change.sizes) {
      const Reading reading = reading_of(one.unit);
      const ShownValue shown = show_read(one.value, one.u95, reading);
      rows.push_back(
          {{since_words(change), html_text(cause_in_words(change.source)), html_text(one.name),
            shown.value, shown.expanded, html_text(reading.unit), others_words(change)}});
    }
  }
  return "<h3>What changed on the arm between sessions</h3>\n" +
         html_table(
             {"",
              {"since session", "what", "parameter", "value", "U (k = 2)", "unit", "or else"},
              rows}) +
         "\n";
}

}  // namespace trammel
