#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "tests/benchmarks/year/score.h"

namespace trammel::year {
namespace {

constexpr double kWidth = 900, kHeight = 150, kLeft = 46, kLow = 3e-6, kHigh = 3e-3;

constexpr std::string_view kPage = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>A year of a plant</title>
<style>{{style}}
svg{width:100%;height:auto}.holes{stroke:#0b66a8}.oracle{stroke:#777}.gp{stroke:#b5651d}polyline{fill:none;stroke-width:1.6}
.event{stroke:#a3123f;stroke-dasharray:4 3}.axis{stroke:#ccc}text{font:11px sans-serif;fill:#555}
h3,svg{break-inside:avoid} @media (max-width:620px){text{font-size:22px}} </style>
</head>
<body>
<main>
<h1>A year of a plant</h1>
<p class="subtitle">{{span}}</p>
<section><p class="verdict">{{verdict}}</p>{{figures}}</section>
<section><h2>Arms</h2>
<p class="note">True error of each arm's holes week by week, mm rms, logarithmic: <b style="color:#0b66a8">as the service said</b>,
<b style="color:#777">of a fresh model (oracle)</b>, <b style="color:#b5651d">of a Gaussian process without physics</b>.
Shaded: weeks in which the service warned. Dashed: something happened to the arm.</p>{{arms}}</section>
<section><h2>What happened</h2>{{events}}</section>
</main>
</body>
</html>)";

/// The weeks that are drawn.
int last_week(const YearScore& score) {
  int last = 1;
  for (const WeekOfArm& week : score.weeks) last = std::max(last, week.week);
  return last;
}

double x_of(int week, int last) { return kLeft + (kWidth - kLeft - 10) * week / last; }
double y_of(double error) {
  const double share = std::log(std::clamp(error, kLow, kHigh) / kLow) / std::log(kHigh / kLow);
  return kHeight - 14 - share * (kHeight - 24);
}

std::string line(const std::vector<WeekOfArm>& weeks, double WeekOfArm::*error,
                 const std::string& kind, int last) {
  std::string points;
  for (const WeekOfArm& week : weeks)
    points += fmt::format("{:.1f},{:.1f} ", x_of(week.week, last), y_of(week.*error));
  return fmt::format("<polyline class=\"{}\" points=\"{}\"/>", kind, points);
}

std::string drawn(const std::string& cell, const std::vector<WeekOfArm>& weeks,
                  const YearScore& score) {
  const int last = last_week(score);
  std::string svg = fmt::format("<h3>{}</h3><svg viewBox=\"0 0 {} {}\" role=\"img\">",
                                html_text(cell), kWidth, kHeight);
  for (const double level : {1e-5, 1e-4, 1e-3})
    svg += fmt::format(
        "<line class=\"axis\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/><text x=\"2\" "
        "y=\"{2:.1f}\">{3}</text>",
        kLeft, kWidth, y_of(level), to_mm(level));
  for (const WeekOfArm& week : weeks)
    if (week.warned)
      svg += fmt::format(
          "<rect x=\"{:.1f}\" y=\"0\" width=\"{:.1f}\" height=\"{}\" fill=\"#f3e3b3\"/>",
          x_of(week.week, last) - 8, 16.0, kHeight - 14);
  for (const EventOfYear& event : score.events)
    if (event.cell == cell)
      svg += fmt::format(
          "<line class=\"event\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"0\" "
          "y2=\"{1}\"><title>{2}</title></line>",
          x_of(event.week, last), kHeight - 14, html_text(event.what));
  svg += line(weeks, &WeekOfArm::without_physics, "gp", last) +
         line(weeks, &WeekOfArm::oracle, "oracle", last) +
         line(weeks, &WeekOfArm::holes, "holes", last);
  for (int week = 0; week < last; week += std::max(1, last / 4))
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\">week {}</text>", x_of(week, last), kHeight - 2,
                       week);
  return svg + "</svg>";
}

std::string told(const EventOfYear& event) {
  if (event.told == Told::kMissed) return "not seen";
  return fmt::format("{} in week {}", event.told == Told::kNamed ? "named" : "seen, left open",
                     event.told_in);
}

}  // namespace

std::string year_page(const YearScore& score) {
  // cell-2 before cell-10.
  const auto shorter_first = [](const std::string& a, const std::string& b) {
    return std::pair(a.size(), a) < std::pair(b.size(), b);
  };
  std::map<std::string, std::vector<WeekOfArm>, decltype(shorter_first)> by_cell(shorter_first);
  for (const WeekOfArm& week : score.weeks) by_cell[week.cell].push_back(week);
  std::string arms;
  for (const auto& [cell, weeks] : by_cell) arms += drawn(cell, weeks, score);
  HtmlTable events;
  events.head = {"cell", "week", "what", "told"};
  for (const EventOfYear& event : score.events)
    events.rows.push_back(
        {{html_text(event.cell), std::to_string(event.week), html_text(event.what), told(event)}});
  HtmlTable figures;
  figures.head = {"figure", "value"};
  const auto row = [&](const std::string& name, int count, int of) {
    figures.rows.push_back({{name, fmt::format("{} of {}", count, of)}});
  };
  row("holes out of tolerance without a warning", score.out_without_warning, score.holes);
  row("holes warned of", score.holes_warned, score.holes);
  row("checks that called a healthy arm changed", score.false_alarms, score.checks);
  row("wrong names among what was said to have changed", score.wrong_names, score.changes_told);
  row("models in force worse than 1.15 times the one before", score.worse, score.steps);
  row("bad batches that went in force", score.bad_in_force, score.bad_batches);
  row("questions without an answer", score.lost, score.asked);
  const auto named = std::count_if(score.events.begin(), score.events.end(),
                                   [](const EventOfYear& e) { return e.told == Told::kNamed; });
  const auto open = std::count_if(score.events.begin(), score.events.end(),
                                  [](const EventOfYear& e) { return e.told == Told::kOpen; });
  const std::string verdict = fmt::format(
      "Of {} things that happened to {} arms, {} were named and {} seen and left open. The server "
      "was killed {} times.",
      score.events.size(), by_cell.size(), named, open, score.kills);
  return fill_in(kPage, {{"style", std::string(page_style())},
                         {"span", fmt::format("{} arms over {} weeks · {}", by_cell.size(),
                                              last_week(score), shown_day(unix_now()))},
                         {"verdict", verdict},
                         {"figures", html_table(figures)},
                         {"arms", arms},
                         {"events", html_table(events)}});
}

}  // namespace trammel::year
