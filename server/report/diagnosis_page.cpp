#include "server/report/diagnosis_page.h"

#include <algorithm>

#include "server/base/units.h"
#include "server/diagnose/tell/wording.h"
#include "server/measurement/pose_columns.h"
#include "server/report/diagnosis_charts.h"
#include "server/report/embedded.h"
#include "server/report/html.h"

namespace trammel {

namespace {

constexpr const char* kProgramVersion = "0.1.0";
constexpr double kDepends = 0.01;  // a p-value below it

std::string micrometres(double m) { return fmt::format("{:.3g}\u00a0µm", m * 1e6); }
std::string millimetres(double m) { return fmt::format("{:.4f}", to_mm(m)); }

/// A table that scrolls by itself where the page is narrow.
std::string table(const char* kind, const std::vector<std::string>& head, const std::string& rows) {
  return fmt::format("<div class=\"wide\"><table class=\"{}\">\n{}{}</table></div>\n", kind, html_row(head, "th"),
                     rows);
}

std::string paragraph(const std::string& text) { return "<p>" + html_text(text) + "</p>\n"; }

/// Without the joint and the pose, which stand in a column of their own.
std::string cause_in_words(const Cause& cause) {
  Cause anywhere = cause;
  anywhere.joint = -1;
  anywhere.pose_id.clear();
  return in_words(anywhere);
}

std::string where_of(const Cause& cause) {
  if (!cause.pose_id.empty()) {
    return fmt::format("{}pose {}", cause.joint >= 0 ? fmt::format("{}, from ", cause.joint + 1) : "", cause.pose_id);
  }
  return cause.joint >= 0 ? fmt::format("{}", cause.joint + 1) : "–";
}

std::string causes_in_words(const std::vector<Cause>& causes) {
  std::string list;
  for (const Cause& cause : causes) {
    list += (list.empty() ? "" : ", ") + in_words(cause);
  }
  return list;
}

std::string unit_shown(const std::string& unit) {
  if (unit == "urad") return "µrad";
  return unit == "um" ? "µm" : unit;
}

/// What is smaller says no more: no test here is that exact.
std::string p_value_shown(double p) {
  constexpr double kLeast = 1e-6;
  return p <= kLeast ? "<\u00a010⁻⁶" : fmt::format("{:.2g}", p);
}

/// Behind the letter: " = 0.02", or that it is smaller than anything that can be told.
std::string p_value_after_p(double p) {
  const std::string shown = p_value_shown(p);
  return (shown.front() == '<' ? " " : " = ") + html_text(shown);
}

std::string estimates_of(const Finding& finding) {
  std::string html;
  for (const Estimate& estimate : finding.parameters) {
    const ShownValue shown = show_with_uncertainty(estimate.value, estimate.u95);
    html += fmt::format("{}<span class=\"estimate\">{}\u00a0=\u00a0{}\u00a0±\u00a0{}\u00a0{}</span>",
                        html.empty() ? "" : "<br>", html_text(estimate.name), shown.value, shown.expanded,
                        html_text(unit_shown(estimate.unit)));
  }
  return html.empty() ? "–" : html;
}

std::string beginning_of(const Finding& finding) {
  const auto& places = finding.may_begin_at;
  if (places.size() < 2) return "";
  const auto place = [](const PossibleBeginning& one) {
    return one.pose_id + (one.time ? fmt::format(" ({:.0f} s)", *one.time) : "");
  };
  return fmt::format(" It may have begun at any of {} poses from {} to {} (95\u00a0%).", places.size(),
                     place(places.front()), place(places.back()));
}

std::string finding_rows(const Finding& finding) {
  const std::string others = causes_in_words(finding.could_also_be);
  const std::string row =
      html_row({"<b>" + html_text(in_words(finding.cause)) + "</b>", html_text(where_of(finding.cause)),
                estimates_of(finding), fmt::format("{:.3g}", finding.effect_rms * 1e6),
                millimetres(finding.held_out_before.rms) + "\u00a0→\u00a0" + millimetres(finding.held_out_after.rms),
                fmt::format("{:.0f}", finding.strength), p_value_shown(finding.p_value),
                others.empty() ? "nothing" : "<span class=\"doubt\">" + html_text(others) + "</span>"});
  return "<tr class=\"found\">" + row.substr(4) +
         fmt::format(
             "<tr class=\"action\"><td></td><td></td><td colspan=\"6\">{} Named by {:.0f}\u00a0% of the "
             "repetitions.</td></tr>\n",
             html_text(as_sentence(finding.action) + beginning_of(finding)), 100 * finding.naming_frequency);
}

std::string findings_text(const Diagnosis& diagnosis) {
  if (diagnosis.findings.empty()) return "<p>None: no known cause passed.</p>\n";
  std::string rows;
  for (const Finding& finding : diagnosis.findings) rows += finding_rows(finding);
  return table("findings",
               {"cause", "joint", "parameter ± U (k = 2)", "effect, µm rms", "held-out rms, mm", "strength λ", "p",
                "could also be"},
               rows);
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
              noise_name(diagnosis.noise, diagnosis.instrument).c_str());
}

std::string figures_row(const char* name, const ErrorFigures& figures) {
  return html_row(
      {name, millimetres(figures.rms), millimetres(figures.mean), millimetres(figures.p997), millimetres(figures.max)});
}

std::string figures_table(const Diagnosis& diagnosis) {
  std::string rows =
      figures_row("all poses, before", diagnosis.before) + figures_row("all poses, after", diagnosis.after);
  if (diagnosis.held_out_before) rows += figures_row("held out, before", *diagnosis.held_out_before);
  if (diagnosis.held_out_after) rows += figures_row("held out, after", *diagnosis.held_out_after);
  if (diagnosis.held_out_before_without && diagnosis.held_out_after_without) {
    rows += figures_row("held out but for those that fit neither, before", *diagnosis.held_out_before_without) +
            figures_row("held out but for those that fit neither, after", *diagnosis.held_out_after_without);
  }
  return table("figures", {"mm", "rms", "mean", "99.7 %", "max"}, rows) +
         (diagnosis.held_out_how.empty() ? "" : paragraph("Held out: " + diagnosis.held_out_how + "."));
}

std::string unexplained_text(const Diagnosis& diagnosis) {
  const Unexplained& left = diagnosis.unexplained;
  if (!left.present) return "";
  const std::string on =
      left.depends_on.empty() ? "nothing known" : fmt::format("{}", fmt::join(left.depends_on, ", "));
  return fmt::format("<p class=\"left\">Unexplained: {} rms that depend on {} (p{}). No known cause fits.</p>\n",
                     micrometres(left.rms), html_text(on), p_value_after_p(left.p_value));
}

std::string leftover_text(const Diagnosis& diagnosis) {
  if (diagnosis.leftover.empty()) return "<p>What is left was not tested against anything.</p>\n";
  std::string rows;
  for (const Dependence& one : diagnosis.leftover) {
    const bool depends = one.p_value < kDepends;
    const std::string row = html_row({depends ? "yes" : "no", one.of_size ? "its size" : "the residual",
                                      html_text(one.on), p_value_shown(one.p_value)});
    rows += fmt::format("<tr class=\"{}\">", depends ? "yes" : "no") + row.substr(4);
  }
  return table("leftover", {"depends", "what of it", "on", "p (Holm)"}, rows);
}

std::string not_separable_text(const Diagnosis& diagnosis) {
  if (diagnosis.not_separable.empty()) return "<p>These poses tell all causes that were looked for apart.</p>\n";
  std::string rows;
  for (const Inseparable& group : diagnosis.not_separable) {
    rows += html_row({html_text(causes_in_words(group.causes)), fmt::format("{:.3f}", group.correlation)});
  }
  return table("confusion", {"look the same at these poses", "canonical correlation"}, rows);
}

JointType type_of(const Cell& cell, Eigen::Index joint) { return cell.robot.joint(static_cast<int>(joint)).type; }

std::string next_poses_table(const std::vector<JointVector>& poses, const Cell& cell) {
  std::vector<std::string> head = {""};
  for (Eigen::Index j = 0; j < poses.front().size(); ++j) {
    head.push_back(fmt::format("q{}, {}", j + 1, type_of(cell, j) == JointType::kRevolute ? "°" : "mm"));
  }
  std::string rows;
  int number = 0;
  for (const JointVector& q : poses) {
    std::vector<std::string> cells = {fmt::format("n{}", ++number)};
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      cells.push_back(fmt::format("{:.2f}", joint_to_column(q(j), type_of(cell, j))));
    }
    rows += html_row(cells);
  }
  return table("poses", head, rows);
}

std::string next_poses_text(const Diagnosis& diagnosis, const Cell& cell) {
  const NextPoses& next = diagnosis.next_poses;
  if (next.q.empty()) return paragraph(as_sentence("None suggested: " + next.none_because));
  return fmt::format(
             "<p>They tell {} apart. What is confounded is uncertain by {} now, <b>by {} with these "
             "poses</b>, by {} with as many random ones.</p>\n",
             html_text(causes_in_words(next.separates)), uncertain_by(next.stddev_now),
             uncertain_by(next.stddev_expected), uncertain_by(next.stddev_random)) +
         next_poses_table(next.q, cell);
}

std::string limits_list(const std::vector<std::string>& limits) {
  if (limits.empty()) return "";
  std::string html = "<ul>\n";
  for (const std::string& limit : limits) html += "<li>" + html_text(as_sentence(limit)) + "</li>\n";
  return html + "</ul>\n";
}

/// Causes and what they need: a row for all the joints of which the same is to be said.
std::string needs_table(const char* heading, const std::vector<Unseen>& unseen) {
  std::vector<std::pair<const Unseen*, std::string>> lines;
  for (const Unseen& one : unseen) {
    const auto same = std::find_if(lines.begin(), lines.end(), [&](const auto& line) {
      return line.first->cause.cause == one.cause.cause && line.first->needs == one.needs;
    });
    if (same == lines.end()) {
      lines.emplace_back(&one, where_of(one.cause));
    } else {
      same->second += ", " + where_of(one.cause);
    }
  }
  std::string rows;
  for (const auto& [one, joints] : lines) {
    rows += html_row({html_text(cause_in_words(one->cause)), html_text(joints), html_text(one->needs)});
  }
  if (rows.empty()) return "";
  return fmt::format("<h3>{}</h3>\n", heading) + table("never", {"cause", "joint", "it needs"}, rows);
}

std::string never_tables(const Diagnosis& diagnosis) {
  std::vector<Unseen> never, never_for_certain;
  for (const Unseen& one : diagnosis.could_not_have_seen) {
    if (one.detectable) continue;
    (is_looked_for_by_order(one, diagnosis.batch) ? never_for_certain : never).push_back(one);
  }
  return needs_table("Would not have shown", never) +
         needs_table("Would not have been named for certain: looked for by the order of the poses", never_for_certain);
}

std::string smallest_table(std::vector<Unseen> unseen) {
  std::erase_if(unseen, [](const Unseen& one) { return !one.detectable; });
  std::stable_sort(unseen.begin(), unseen.end(),
                   [](const Unseen& a, const Unseen& b) { return *a.detectable > *b.detectable; });
  std::string rows;
  for (const Unseen& one : unseen) {
    rows += html_row({html_text(cause_in_words(one.cause)), html_text(where_of(one.cause)),
                      fmt::format("{:.3g}", *one.detectable * 1e6),
                      one.identifiable ? fmt::format("{:.3g}", *one.identifiable * 1e6) : "never",
                      fmt::format("{:.0f}\u00a0%", 100 * one.outside), html_text(one.needs)});
  }
  if (rows.empty()) return "";
  return "<h3>Would have shown from this size on</h3>\n<div class=\"tall\">" +
         table("unseen", {"cause", "joint", "noticed, µm rms", "named, µm rms", "its own share", "it needs"}, rows) +
         "</div>\n";
}

std::string unseen_text(const Diagnosis& diagnosis) {
  const std::string html =
      limits_list(diagnosis.limits) + never_tables(diagnosis) + smallest_table(diagnosis.could_not_have_seen);
  return html.empty() ? "<p>Every cause that was looked for would have shown.</p>\n" : html;
}

std::string suspects_text(const Diagnosis& diagnosis) {
  if (diagnosis.suspects.empty()) return "<p>None: every pose fits the others.</p>\n";
  std::string rows;
  for (const SuspectedPose& pose : diagnosis.suspects) {
    rows += html_row({html_text(pose.pose_id), fmt::format("{}", pose.row), fmt::format("{:.3g}", pose.distance * 1e6),
                      html_text(pose.reason)});
  }
  return table("suspects", {"pose", "row", "off by, µm", "why"}, rows);
}

std::string provenance_table(const Diagnosis& diagnosis, const Cell& cell) {
  const auto line = [](const std::string& name, const std::string& value) {
    return html_row({name, html_text(value)});
  };
  return line("cell", cell.name) + line("robot", cell.robot.name()) + line("cell hash (SHA-256)", diagnosis.cell_hash) +
         line("batch", diagnosis.batch.id) + line("batch hash (SHA-256)", diagnosis.batch_hash) +
         line("poses", fmt::format("{} used, {} listed above", diagnosis.poses, diagnosis.suspects.size())) +
         line(noise_name(diagnosis.noise, diagnosis.instrument) + ", per axis",
              fmt::format("{} ({})", micrometres(diagnosis.noise), diagnosis.noise_from)) +
         line("error sources before", fmt::format("{}", fmt::join(diagnosis.sources_before, ", "))) +
         line("error sources after", fmt::format("{}", fmt::join(diagnosis.sources_after, ", "))) +
         line("made by", fmt::format("trammel {}, seed {}", kProgramVersion, diagnosis.seed));
}

/// For the charts. `<` is escaped so that no text can end the script that holds it.
std::string chart_data(const Diagnosis& diagnosis, const Cell& cell) {
  std::string text =
      diagnosis_charts(diagnosis, cell).dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at))
    text.replace(at, 1, "\\u003c");
  return text;
}

}  // namespace

std::string diagnosis_page(const Diagnosis& diagnosis, const Cell& cell) {
  return fill_in(embedded::diagnosis_page_html,
                 {{"title", html_text(fmt::format("Cell {}: what batch {} says", cell.name, diagnosis.batch.id))},
                  {"subtitle", html_text(fmt::format("{} · {} poses", cell.robot.name(), diagnosis.poses))},
                  {"verdict", std::string(to_string(diagnosis.verdict))},
                  {"sentence", html_text(diagnosis.sentence)},
                  {"tiles", tiles(diagnosis)},
                  {"findings", findings_text(diagnosis)},
                  {"unexplained", unexplained_text(diagnosis)},
                  {"figures", figures_table(diagnosis)},
                  {"confusion", not_separable_text(diagnosis)},
                  {"next_poses", next_poses_text(diagnosis, cell)},
                  {"unseen", unseen_text(diagnosis)},
                  {"suspects", suspects_text(diagnosis)},
                  {"leftover", leftover_text(diagnosis)},
                  {"provenance", provenance_table(diagnosis, cell)},
                  {"data", chart_data(diagnosis, cell)},
                  {"chart_js", std::string(embedded::chart_js)}});
}

}  // namespace trammel
