#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <map>
#include <regex>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/report/embedded.h"
#include "server/report/history.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/pages_beside.h"
#include "server/report/plain_page.h"

namespace trammel {

namespace {

/// The layout of a drawing, px.
struct Frame {
  double width = 0, height = 0, margin = 0;
  double low = 0, high = 0;  // of the drawn values
  std::size_t places = 1;    // from left to right
  [[nodiscard]] double x(std::size_t place) const {
    const double step =
        places < 2 ? 0 : static_cast<double>(place) / static_cast<double>(places - 1);
    return margin + step * (width - 2 * margin);
  }
  [[nodiscard]] double y(double value) const {
    const double share = high > low ? (value - low) / (high - low) : 0.5;
    return height - margin - share * (height - 2 * margin);
  }
};

std::string day_of(std::int64_t unix_time) {
  if (unix_time <= 0) return "";
  const std::time_t time = unix_time;
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", &utc);
  return text.data();
}

std::string millimetres(const std::optional<double>& m) {
  return m ? fmt::format("{:.4f}", to_mm(*m)) : "–";
}

using Track = std::map<int, const ParameterOnRecord*>;  // by version

/// A whisker of ± U at each version that has the parameter, and a line through the values.
std::string track_svg(const Track& track, const std::vector<int>& versions) {
  Frame frame{
      240, 40, 6, track.begin()->second->value, track.begin()->second->value, versions.size()};
  for (const auto& [version, one] : track) {
    frame.low = std::min(frame.low, one->value - one->u95);
    frame.high = std::max(frame.high, one->value + one->u95);
  }
  std::string marks, line;
  for (std::size_t place = 0; place < versions.size(); ++place) {
    const auto found = track.find(versions[place]);
    if (found == track.end()) continue;
    const ParameterOnRecord& one = *found->second;
    const double x = frame.x(place);
    marks += fmt::format(
        R"(<path d="M{0:.1f} {1:.1f}V{2:.1f}"/><circle cx="{0:.1f}" cy="{3:.1f}" r="2.5"/>)", x,
        frame.y(one.value - one.u95), frame.y(one.value + one.u95), frame.y(one.value));
    line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x, frame.y(one.value));
  }
  return fmt::format(
      R"(<svg class="track" viewBox="0 0 240 40" role="img"><path class="line" d="{}"/>{}</svg>)",
      line, marks);
}

struct Tracked {
  const ParameterOnRecord* last = nullptr;
  const ParameterOnRecord* first = nullptr;
  Track track;
};

/// In the order of the newest version, then parameters that only older versions have.
std::vector<Tracked> tracked(const CellHistory& history) {
  std::vector<Tracked> all;
  for (auto version = history.versions.rbegin(); version != history.versions.rend(); ++version) {
    for (const ParameterOnRecord& one : version->parameters) {
      auto found = std::find_if(all.begin(), all.end(), [&](const Tracked& t) {
        return t.last->cause == one.cause && t.last->name == one.name && t.last->unit == one.unit;
      });
      if (found == all.end()) found = all.insert(all.end(), Tracked{&one, &one, {}});
      found->first = &one;
      found->track[version->version] = &one;
    }
  }
  return all;
}

bool has_moved(const std::vector<Moved>& moved, const ParameterOnRecord& one) {
  return std::any_of(moved.begin(), moved.end(), [&](const Moved& m) {
    return m.cause == one.cause && m.parameter == one.name;
  });
}

std::string value_in(const Track& track, int version, const Reading& reading) {
  const auto found = track.find(version);
  if (found == track.end()) return "not in it";
  const ShownValue value = show_read(found->second->value, found->second->u95, reading);
  return fmt::format("{} ± {}", value.value, value.expanded);
}

/// The version in force. For files, or if that version has no parameters on record, the newest with
/// parameters; nullptr: none.
const VersionOnRecord* shown_version(const CellHistory& history) {
  const VersionOnRecord* newest = nullptr;
  for (const VersionOnRecord& one : history.versions) {
    if (one.parameters.empty()) continue;
    if (one.in_force) return &one;
    newest = &one;
  }
  return newest;
}

std::string parameter_table(const CellHistory& history, const std::vector<Moved>& moved) {
  std::vector<int> versions;
  for (const VersionOnRecord& one : history.versions)
    if (!one.parameters.empty()) versions.push_back(one.version);
  const VersionOnRecord* shown = shown_version(history);
  if (shown == nullptr) return "<p>No version has any.</p>";
  std::vector<HtmlRow> rows;
  std::string cause;
  for (const Tracked& one : tracked(history)) {
    const ParameterOnRecord& last = *one.last;
    if (last.cause != cause) rows.push_back({{html_text(last.cause)}, "cause", 5});
    cause = last.cause;
    const Reading reading = reading_of(last.unit);
    const ShownValue first = show_read(one.first->value, one.first->u95, reading);
    const bool marked = has_moved(moved, last);
    rows.push_back({{html_text(last.name), fmt::format("{} ± {}", first.value, first.expanded),
                     value_in(one.track, shown->version, reading), html_text(reading.unit),
                     track_svg(one.track, versions)},
                    marked            ? "moved"
                    : last.identified ? ""
                                      : "unknown"});
  }
  const std::string now =
      fmt::format("version {}{}", shown->version, shown->in_force ? " (in force)" : "");
  return html_table({"parameters flows",
                     {"parameter", "first", now, "unit", "over the versions, ± U (k = 2)"},
                     rows});
}

std::string version_table(const CellHistory& history) {
  std::vector<HtmlRow> rows;
  for (const VersionOnRecord& one : history.versions) {
    rows.push_back({{fmt::format("{}{}", one.version, one.in_force ? " (in force)" : ""),
                     day_of(one.trained_at), html_text(one.batches), std::to_string(one.poses),
                     millimetres(one.validation_rms)},
                    one.in_force ? "now" : ""});
  }
  return html_table({"versions stacks",
                     {"version", "trained (UTC)", "batches", "poses", "held-out rms, mm"},
                     rows});
}

std::string outcome_of(const TrainingOnRecord& one) {
  std::string verdict = one.verdict;
  std::replace(verdict.begin(), verdict.end(), '_', ' ');
  return one.why.empty() ? verdict : verdict + ": " + one.why;
}

std::string training_table(const CellHistory& history) {
  if (history.trainings.empty()) return "<p>None on record.</p>";
  std::vector<HtmlRow> rows;
  for (const TrainingOnRecord& one : history.trainings) {
    rows.push_back({{day_of(one.at), html_text(one.batches), millimetres(one.before),
                     millimetres(one.after), html_text(outcome_of(one))}});
  }
  return html_table(
      {"trainings stacks", {"ended (UTC)", "batches", "before, mm", "after, mm", "outcome"}, rows});
}

/// Hashes cut to the digits by which people tell models apart; the audit trail has them whole.
std::string with_short_hashes(const std::string& text) {
  static const std::regex kHash("\\b([0-9a-f]{12})[0-9a-f]{52}\\b");
  return std::regex_replace(text, kHash, "$1…");
}

std::string from_to(const EventOnRecord& one) {
  if (one.before.empty() && one.after.empty()) return "";
  return with_short_hashes(fmt::format("{} → {}", one.before.empty() ? "nothing" : one.before,
                                       one.after.empty() ? "nothing" : one.after));
}

std::string event_table(const CellHistory& history) {
  if (history.events.empty()) return "<p>None.</p>";
  std::vector<HtmlRow> rows;
  for (const EventOnRecord& one : history.events) {
    rows.push_back({{day_of(one.at), html_text(one.what), html_text(one.subject),
                     html_text(from_to(one)), html_text(one.why), html_text(one.who)}});
  }
  return html_table(
      {"events stacks", {"when (UTC)", "what", "of what", "from → to", "why", "who"}, rows});
}

std::string in_force_sentence(const CellHistory& history) {
  for (const VersionOnRecord& one : history.versions)
    if (one.in_force)
      return fmt::format("Version {} is in force, trained on {}.", one.version,
                         day_of(one.trained_at));
  return history.of_files ? "Model files do not say which version is in force."
                          : "No version in force is on record.";
}

std::string verdict(const CellHistory& history, const std::vector<Moved>& moved) {
  const VersionOnRecord* now = shown_version(history);
  std::string text = in_force_sentence(history);
  std::string list;
  if (now != nullptr)
    for (const Note& note : now->notes) list += "<li>" + html_text(note.text) + "</li>";
  for (const Moved& one : moved) {
    const Reading reading = reading_of(one.unit);
    const ShownValue step = show_read(one.to - one.from, one.u95, reading);
    list += fmt::format("<li>{}, {}: {} ± {} {} from version {} to {}</li>", html_text(one.cause),
                        html_text(one.parameter), step.value, step.expanded,
                        html_text(reading.unit), one.from_version, one.to_version);
  }
  if (moved.empty()) {
    text += fmt::format(
        " No {}parameter of the arm moved by more than its uncertainty between versions.",
        list.empty() ? "" : "other ");
  }
  return "<p>" + text + "</p>" + (list.empty() ? "" : "<ul>" + list + "</ul>");
}

/// From when to when.
std::string span_of(const CellHistory& history) {
  if (history.versions.empty()) return "No version on record.";
  const VersionOnRecord &first = history.versions.front(), &last = history.versions.back();
  return fmt::format("Versions {} to {}, trained from {} to {} UTC{}", first.version, last.version,
                     day_of(first.trained_at), day_of(last.trained_at), papers_text(last.papers));
}

}  // namespace

std::string history_page(const CellHistory& history) {
  const std::vector<Moved> moved = moved_parameters(history);
  const std::string title = "History of cell " + html_text(history.cell);
  return fill_in(embedded::history_page_html, {{"page_css", std::string(page_style())},
                                               {"title", title},
                                               {"span", html_text(span_of(history))},
                                               {"mark", page_mark({"history", history.cell})},
                                               {"verdict", verdict(history, moved)},
                                               {"versions", version_table(history)},
                                               {"trainings", training_table(history)},
                                               {"parameters", parameter_table(history, moved)},
                                               {"events", event_table(history)}});
}

}  // namespace trammel
