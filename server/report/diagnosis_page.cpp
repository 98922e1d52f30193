#include "server/report/diagnosis_page.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/diagnose/tell/wording.h"
#include "server/error_sources/cause_words.h"
#include "server/measurement/pose_columns.h"
#include "server/report/budget_page.h"
#include "server/report/diagnosis_charts.h"
#include "server/report/embedded.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/pages_beside.h"
#include "server/report/proof_page.h"
#include "server/robot/cell_papers.h"

namespace trammel {

namespace {

constexpr const char* kProgramVersion = "0.1.0";
constexpr const char* kRecovery =
    "<section class=\"screen\">\n<h2>How large an effect must be</h2>\n<p class=\"note\">Effects "
    "of "
    "known size hidden in these very poses with noise as found: how often they were named "
    "rightly.</p>\n<div class=\"charts one\"><div class=\"chart\" "
    "id=\"recovery\"></div></div>\n</section>\n";
constexpr double kBeyondDoubt = 1e6;  // a strength of which the digits say nothing more
constexpr double kDepends =
    0.01;  // p-value below which the table says yes: 1 of 100 batches by chance

/// Three digits, and all of those in front of the point.
std::string plain(double number) {
  return std::abs(number) < 1000 ? fmt::format("{:.3g}", number) : fmt::format("{:.0f}", number);
}
std::string micrometres(double m) { return plain(m * 1e6) + "\u00a0µm"; }
std::string millimetres(double m) { return fmt::format("{:.4f}", to_mm(m)); }

/// A table that scrolls by itself where the page is narrow.
std::string table(const HtmlTable& table) {
  return "<div class=\"wide\">" + html_table(table) + "</div>\n";
}

std::string paragraph(const std::string& text) { return "<p>" + html_text(text) + "</p>\n"; }

std::string where_of(const Cause& cause) {
  if (!cause.pose_id.empty()) {
    return fmt::format("{}pose {}",
                       cause.joint >= 0 ? fmt::format("{}, from ", cause.joint + 1) : "",
                       cause.pose_id);
  }
  return cause.joint >= 0 ? fmt::format("{}", cause.joint + 1) : "–";
}

std::string all_in_words(const std::vector<Cause>& causes) {
  std::string list;
  for (const Cause& cause : causes) list += (list.empty() ? "" : ", ") + in_words(cause);
  return list;
}

std::string unit_shown(const std::string& unit) {
  if (unit == "urad") return "µrad";
  return unit == "um" ? "µm" : unit;
}

std::string p_value_shown(double p) {
  return p <= kLeastPValue ? "<\u00a010⁻⁶" : fmt::format("{:.2g}", p);
}

/// The text behind the letter p: " = 0.02" or " < 10⁻⁶".
std::string p_value_after_p(double p) {
  const std::string shown = p_value_shown(p);
  return (shown.front() == '<' ? " " : " = ") + html_text(shown);
}

std::string estimates_of(const Finding& finding) {
  std::string html;
  for (const Estimate& estimate : finding.parameters) {
    const Reading reading = reading_of(estimate.unit);
    const ShownValue shown = show_read(estimate.value, estimate.u95, reading);
    html +=
        fmt::format("{}<span class=\"estimate\">{}\u00a0=\u00a0{}\u00a0±\u00a0{}\u00a0{}</span>",
                    html.empty() ? "" : "<br>", html_text(estimate.name), shown.value,
                    shown.expanded, html_text(unit_shown(reading.unit)));
  }
  return html.empty() ? "–" : html;
}

std::string beginning_of(const Finding& finding) {
  const auto& places = finding.may_begin_at;
  if (places.size() < 2) return "";
  const auto place = [](const PossibleBeginning& one) {
    return one.pose_id + (one.time ? fmt::format(" ({:.0f} s)", *one.time) : "");
  };
  return fmt::format(" It may have begun at any of {} poses from {} to {} (95\u00a0%).",
                     places.size(), place(places.front()), place(places.back()));
}

/// The other causes that it could be, for people.
std::string others_of(const Finding& finding) {
  return finding.whole ? all_in_words(finding.could_also_be)
                       : "part of it only: more than noise is left";
}

HtmlRow finding_row(const Finding& finding) {
  const std::string others = others_of(finding);
  return {.cells = {"<b>" + html_text(kind_called(finding.cause, !finding.could_also_be.empty())) +
                        "</b>",
                    html_text(where_of(finding.cause)), estimates_of(finding),
                    plain(finding.effect_rms * 1e6),
                    millimetres(finding.held_out_before.rms) + " → " +
                        millimetres(finding.held_out_after.rms),
                    finding.strength > kBeyondDoubt ? "&gt; 10⁶"
                                                    : fmt::format("{:.0f}", finding.strength),
                    p_value_shown(finding.p_value),
                    others.empty() ? "no other known cause"
                                   : "<span class=\"doubt\">" + html_text(others) + "</span>"},
          .kind = "found"};
}

/// The row with the action, below the figures.
HtmlRow action_row(const Finding& finding) {
  return {.cells = {"", "", html_text(as_sentence(finding.action) + beginning_of(finding))},
          .kind = "action",
          .last_spans = 6};
}

std::string findings_text(const Diagnosis& diagnosis) {
  if (diagnosis.findings.empty()) return "<p>None: no known cause passed.</p>\n";
  std::vector<HtmlRow> rows;
  for (const Finding& finding : diagnosis.findings) {
    rows.push_back(finding_row(finding));
    rows.push_back(action_row(finding));
  }
  return table({"findings",
                {"cause", "joint", "parameter ± U (k = 2)", "effect, µm rms", "held-out rms, mm",
                 "strength λ", "p", "could also be"},
                rows});
}

std::string tile(const char* kind, const std::string& value, const char* name) {
  return fmt::format(R"(<div class="tile {}"><b>{}</b><span>{}</span></div>)", kind, value, name);
}

std::string tiles(const Diagnosis& diagnosis) {
  const bool held_out = diagnosis.held_out_before && diagnosis.held_out_after;
  const ErrorFigures& before = held_out ? *diagnosis.held_out_before : diagnosis.before;
  const ErrorFigures& after = held_out ? *diagnosis.held_out_after : diagnosis.after;
  const char* before_name = held_out ? "rms of poses held out, before" : "rms of all poses, before";
  return tile("before", fmt::format("{:.4f} mm", to_mm(before.rms)), before_name) +
         tile("after", fmt::format("{:.4f} mm", to_mm(after.rms)), "with what was found") +
         tile("noise", fmt::format("{:.4f} mm", to_mm(std::sqrt(3.0) * diagnosis.noise)),
              html_text(
                  "noise, rms: what is left of a position when all that was found is corrected (" +
                  with_micro(diagnosis.noise_from) + ")")
                  .c_str());
}

HtmlRow figures_row(const char* name, const ErrorFigures& figures) {
  return {{name, millimetres(figures.rms), millimetres(figures.mean), millimetres(figures.p997),
           millimetres(figures.max)}};
}

std::string figures_table(const Diagnosis& diagnosis) {
  std::vector<HtmlRow> rows = {figures_row("all poses, before", diagnosis.before),
                               figures_row("all poses, after", diagnosis.after)};
  const auto add = [&](const char* name, const std::optional<ErrorFigures>& figures) {
    if (figures) rows.push_back(figures_row(name, *figures));
  };
  add("held out, before", diagnosis.held_out_before);
  add("held out, after", diagnosis.held_out_after);
  add("held out but for those that fit neither, before", diagnosis.held_out_before_without);
  add("held out but for those that fit neither, after", diagnosis.held_out_after_without);
  return table({"figures", {"mm", "rms", "mean", "99.7 %", "max"}, rows}) +
         (diagnosis.held_out_how.empty() ? ""
                                         : paragraph("Held out: " + diagnosis.held_out_how + "."));
}

std::string unexplained_text(const Diagnosis& diagnosis) {
  const Unexplained& left = diagnosis.unexplained;
  if (!left.present) return "";
  // The p-value of the test: without a dependence it is that of the noise.
  const std::string p = fmt::format(" (p{})", p_value_after_p(left.p_value));
  const bool depends = !left.depends_on.empty();
  const std::string changes = html_text(what_it_changes_with(left.depends_on)) + (depends ? p : "");
  return fmt::format("<p class=\"left\">Unexplained: {} rms{}. {} No known cause fits.</p>\n",
                     micrometres(left.rms), depends ? "" : ", more than the stated noise" + p,
                     as_sentence(changes));
}

std::string leftover_text(const Diagnosis& diagnosis) {
  if (diagnosis.leftover.empty()) return "<p>What is left was not tested against anything.</p>\n";
  std::vector<HtmlRow> rows;
  for (const Dependence& one : diagnosis.leftover) {
    const char* depends = one.p_value < kDepends ? "yes" : "no";
    rows.push_back({.cells = {depends, one.of_size ? "its size" : "the residual", html_text(one.on),
                              p_value_shown(one.p_value)},
                    .kind = depends});
  }
  return table({"leftover", {"depends", "what of it", "on", "p (Holm)"}, rows});
}

std::string not_separable_text(const Diagnosis& diagnosis) {
  std::vector<HtmlRow> rows;
  for (const Inseparable& group : diagnosis.not_separable) {
    if (is_never_shown(diagnosis, group.causes.front())) continue;
    rows.push_back(
        {{html_text(all_in_words(group.causes)), fmt::format("{:.3f}", group.correlation)}});
  }
  if (rows.empty()) return "<p>These poses tell all causes apart that they show.</p>\n";
  return table(
      {"confusion stacks", {"look the same at these poses", "canonical correlation"}, rows});
}

JointType type_of(const Cell& cell, Eigen::Index joint) {
  return cell.robot.joint(static_cast<int>(joint)).type;
}

std::string next_poses_table(const std::vector<JointVector>& poses, const Cell& cell) {
  std::vector<std::string> head = {""};
  for (Eigen::Index j = 0; j < poses.front().size(); ++j) {
    head.push_back(
        fmt::format("q{}, {}", j + 1, type_of(cell, j) == JointType::kRevolute ? "°" : "mm"));
  }
  std::vector<HtmlRow> rows;
  for (const JointVector& q : poses) {
    std::vector<std::string> cells = {fmt::format("n{}", rows.size() + 1)};
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      cells.push_back(fmt::format("{:.2f}", joint_to_column(q(j), type_of(cell, j))));
    }
    rows.push_back({cells});
  }
  return table({"poses", head, rows});
}

std::string next_poses_text(const Diagnosis& diagnosis, const Cell& cell) {
  const NextPoses& next = diagnosis.next_poses;
  if (next.q.empty()) return paragraph(as_sentence("None suggested: " + next.none_because));
  return fmt::format(
             "<p>They tell {} apart. What is confounded is uncertain by {} now, <b>by {} with "
             "these poses</b>, by {} with as many random ones.</p>\n",
             html_text(all_in_words(next.separates)), uncertain_by(next.stddev_now),
             uncertain_by(next.stddev_expected), uncertain_by(next.stddev_random)) +
         next_poses_table(next.q, cell);
}

std::string limits_list(const std::vector<std::string>& limits) {
  if (limits.empty()) return "";
  std::string html = "<ul>\n";
  for (const std::string& limit : limits)
    html += "<li>" + html_text(as_sentence(limit)) + "</li>\n";
  return html + "</ul>\n";
}

/// One row for all joints with the same need.
struct Need {
  const Unseen* one = nullptr;
  std::string joints;
};

std::vector<Need> needs_of(const std::vector<Unseen>& unseen) {
  std::vector<Need> needs;
  for (const Unseen& one : unseen) {
    const auto same = std::find_if(needs.begin(), needs.end(), [&](const Need& need) {
      return need.one->cause.cause == one.cause.cause && need.one->needs == one.needs;
    });
    if (same == needs.end()) {
      needs.push_back({&one, where_of(one.cause)});
    } else {
      same->joints += ", " + where_of(one.cause);
    }
  }
  return needs;
}

std::string needs_table(const char* heading, const std::vector<Unseen>& unseen) {
  if (unseen.empty()) return "";
  std::vector<HtmlRow> rows;
  for (const Need& need : needs_of(unseen)) {
    rows.push_back({{html_text(kind_in_words(need.one->cause)), html_text(need.joints),
                     html_text(need.one->needs)}});
  }
  return fmt::format("<h3>{}</h3>\n", heading) +
         table({"never stacks", {"cause", "joint", "it needs"}, rows});
}

std::string never_tables(const Diagnosis& diagnosis) {
  std::vector<Unseen> never, never_for_certain;
  for (const Unseen& one : diagnosis.could_not_have_seen) {
    if (one.detectable) continue;
    (is_looked_for_by_order(one, diagnosis.batch) ? never_for_certain : never).push_back(one);
  }
  return needs_table("Would not have shown", never) +
         needs_table("Would not have been named for certain: looked for by the order of the poses",
                     never_for_certain);
}

HtmlRow smallest_row(const Unseen& one) {
  return {{html_text(kind_in_words(one.cause)), html_text(where_of(one.cause)),
           fmt::format("{:.3g}", *one.detectable * 1e6),
           one.identifiable ? fmt::format("{:.3g}", *one.identifiable * 1e6) : "never",
           fmt::format("{:.0f}\u00a0%", 100 * one.outside), html_text(one.needs)}};
}

std::string smallest_table(std::vector<Unseen> unseen) {
  std::erase_if(unseen, [](const Unseen& one) { return !one.detectable; });
  if (unseen.empty()) return "";
  std::stable_sort(unseen.begin(), unseen.end(),
                   [](const Unseen& a, const Unseen& b) { return *a.detectable > *b.detectable; });
  std::vector<HtmlRow> rows;
  std::transform(unseen.begin(), unseen.end(), std::back_inserter(rows), smallest_row);
  return "<div class=\"screen\"><h3>Would have shown from this size on</h3>\n<div class=\"tall\">" +
         table({"unseen stacks",
                {"cause", "joint", "noticed, µm rms", "named, µm rms", "its own share", "it needs"},
                rows}) +
         "</div></div>\n";
}

std::string unseen_text(const Diagnosis& diagnosis) {
  const std::string html = limits_list(diagnosis.limits) + never_tables(diagnosis) +
                           smallest_table(diagnosis.could_not_have_seen);
  return html.empty() ? "<p>Every cause that was looked for would have shown.</p>\n" : html;
}

std::string suspects_text(const Diagnosis& diagnosis) {
  if (diagnosis.suspects.empty()) return "<p>None: every pose fits the others.</p>\n";
  std::vector<HtmlRow> rows;
  for (const SuspectedPose& pose : diagnosis.suspects) {
    rows.push_back({{html_text(pose.pose_id), fmt::format("{}", pose.row),
                     fmt::format("{:.3g}", pose.distance * 1e6), html_text(pose.reason)}});
  }
  return table({"suspects stacks", {"pose", "row", "off by, µm", "why"}, rows});
}

std::string provenance_rows(const Diagnosis& diagnosis, const Cell& cell) {
  std::vector<HtmlRow> rows;
  const auto add = [&](const std::string& name, const std::string& value) {
    rows.push_back({{name, html_text(value)}});
  };
  add("cell", cell.name);
  add("robot", cell.robot.name());
  const CellPapers papers = papers_of(cell).value_or(CellPapers());
  for (const auto& [name, text] :
       {std::pair("serial number", papers.serial_number),
        std::pair("instrument", papers.instrument), std::pair("operator", papers.operator_name)})
    if (!text.empty()) add(name, text);
  add("cell hash (SHA-256)", diagnosis.cell_hash);
  add("batch", diagnosis.batch.id);
  add("batch hash (SHA-256)", diagnosis.batch_hash);
  add("poses", fmt::format("{} used, {} listed above", diagnosis.poses, diagnosis.suspects.size()));
  add("error sources before", causes_in_words(diagnosis.sources_before));
  add("error sources after", causes_in_words(diagnosis.sources_after));
  add("made by", fmt::format("trammel {}, seed {}", kProgramVersion, diagnosis.seed));
  return html_rows(rows);
}

/// ` · measured 2026-11-22`; empty where it is not known.
std::string measured_on(const Diagnosis& diagnosis) {
  const auto& at = diagnosis.batch.measured_at;
  return at ? " · measured " + shown_day(*at) : "";
}

}  // namespace

std::string diagnosis_page(const Diagnosis& diagnosis, const Cell& cell,
                           const std::string& after_repair) {
  return fill_in(embedded::diagnosis_page_html,
                 {{"page_css", std::string(page_style())},
                  {"mark", page_mark({"diagnosis", cell.name})},
                  {"title", html_text(fmt::format("Cell {}: what batch {} says", cell.name,
                                                  diagnosis.batch.id))},
                  {"subtitle", html_text(fmt::format("{} · {} poses{}", cell.robot.name(),
                                                     diagnosis.poses, measured_on(diagnosis)))},
                  {"verdict", std::string(to_string(diagnosis.verdict))},
                  {"verdict_in_words", verdict_in_words(to_string(diagnosis.verdict))},
                  {"sentence", html_text(with_micro(diagnosis.sentence))},
                  {"tiles", tiles(diagnosis)},
                  {"findings", findings_text(diagnosis)},
                  {"unexplained", unexplained_text(diagnosis)},
                  {"figures", figures_table(diagnosis)},
                  {"budget", after_repair + budget_section(diagnosis.budget)},
                  {"confusion", not_separable_text(diagnosis)},
                  {"next_poses", next_poses_text(diagnosis, cell)},
                  {"unseen", unseen_text(diagnosis)},
                  {"proof", diagnosis.proof ? proof_section(*diagnosis.proof) : kRecovery},
                  {"suspects", suspects_text(diagnosis)},
                  {"leftover", leftover_text(diagnosis)},
                  {"provenance", provenance_rows(diagnosis, cell)},
                  {"data", script_json(diagnosis_charts(diagnosis, cell))},
                  {"chart_js", std::string(embedded::chart_js)}});
}

}  // namespace trammel
