#include "server/report/health_page.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "server/error_sources/spelling.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/plain_page.h"
#include "server/report/pose_picture.h"

namespace trammel {
namespace {

using nlohmann::json;

constexpr std::size_t kSizesOnPage = 8;  // the sizes that are hardest to see

std::string text_in(const json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_string()
             ? object[key].get<std::string>()
             : "";
}

std::string mm_in(const json& object, const char* key) {
  const bool known = object.is_object() && object.contains(key) && object[key].is_number();
  return known ? fmt::format("{:.4f} mm", object[key].get<double>()) : "–";
}

const json& list_in(const json& object, const char* key) {
  static const json kNone = json::array();
  return object.is_object() && object.contains(key) && object[key].is_array() ? object[key] : kNone;
}

/// `gear ripple in joint 3, order`
std::string cause_of(const json& one) {
  std::string spelling = text_in(one, "cause");
  if (one.is_object() && one.contains("joint") && one["joint"].is_number_integer())
    spelling += fmt::format(":{}", one["joint"].get<int>());
  const std::string parameter = text_in(one, "parameter");
  return in_words(spelling) + (parameter.empty() ? "" : ", " + parameter);
}

/// `link geometry, d6`; for zeros, the joints and the sizes.
std::string change_of(const json& one) {
  std::vector<std::string> zeros;
  for (const json& zero : list_in(one, "zeros")) {
    if (zero.is_object() && zero.contains("joint") && zero.contains("deg") &&
        zero.contains("u95_deg") && zero["joint"].is_number_integer() && zero["deg"].is_number() &&
        zero["u95_deg"].is_number())
      zeros.push_back(fmt::format("joint {} by {:.3f} ± {:.3f} deg, alone {}",
                                  zero["joint"].get<int>(), zero["deg"].get<double>(),
                                  zero["u95_deg"].get<double>(), mm_in(zero, "effect_rms_mm")));
  }
  if (zeros.empty()) return cause_of(one);
  return fmt::format(
      "{} ({})", zeros.size() > 1 ? "zeros of several joints: was it remastered?" : cause_of(one),
      fmt::join(zeros, "; "));
}

std::string figures(const json& found) {
  std::vector<HtmlRow> rows;
  const auto add = [&](const char* name, const std::string& value) {
    rows.push_back({{name, html_text(value)}});
  };
  add("tolerance", mm_in(found, "tolerance_mm"));
  add("what the poses are off by, rms", mm_in(found, "rms_mm"));
  add("what a healthy robot is off by, rms", mm_in(found, "expected_rms_mm"));
  add("largest change that could hide", mm_in(found, "would_have_seen_mm"));
  const std::string due = text_in(found, "due"), because = text_in(found, "due_because");
  const std::string model = text_in(found, "model");
  if (!model.empty()) add("held against model", model);
  add("check again by",
      (due.empty() ? "cannot be said" : due) + (because.empty() ? "" : ": " + because));
  return html_table({"", {}, rows});
}

std::string changes(const json& found) {
  std::vector<HtmlRow> rows;
  for (const json& one : list_in(found, "changed")) {
    std::vector<std::string> others;
    for (const json& other : list_in(one, "could_also_be")) others.push_back(cause_of(other));
    const bool here = text_in(one, "effect_over") == "these_poses";
    rows.push_back(
        {{html_text(change_of(one)), mm_in(one, "effect_rms_mm") + (here ? " at these poses" : ""),
          mm_in(one, "u95"), html_text(fmt::format("{}", fmt::join(others, ", ")))}});
  }
  return rows.empty()
             ? "<p>Nothing that these poses show.</p>"
             : html_table(
                   {"stacks", {"what changed", "effect, rms", "U (k = 2)", "could also be"}, rows});
}

std::string hardest_to_see(const json& found) {
  std::vector<HtmlRow> rows;
  for (const json& one : list_in(found, "smallest_seen")) {
    if (rows.size() == kSizesOnPage) break;
    const std::string size = mm_in(one, "effect_rms_mm");
    rows.push_back({{html_text(cause_of(one)), size == "–" ? "never" : size}});
  }
  return rows.empty() ? "<p>Not known.</p>" : html_table({"", {"cause", "seen from, rms"}, rows});
}

std::optional<Vector3> vector_in(const json& object, const char* key) {
  const json& numbers = list_in(object, key);
  const bool three =
      numbers.size() == 3 &&
      std::all_of(numbers.begin(), numbers.end(), [](const json& n) { return n.is_number(); });
  if (!three) return std::nullopt;
  return Vector3(numbers[0].get<double>(), numbers[1].get<double>(), numbers[2].get<double>());
}

/// The poses drawn, and as a table, the worst first. Empty for a check that did not record them.
std::string poses_of_check(const json& found) {
  struct Row {
    DrawnPose drawn;
    std::string expected;
  };
  std::vector<Row> poses;
  for (const json& one : list_in(found, "at_poses")) {
    const auto place = vector_in(one, "xyz_mm"), off = vector_in(one, "off_mm");
    if (!place || !off) continue;
    const bool suspect = one.contains("suspect") && one["suspect"] == true;
    poses.push_back({{text_in(one, "pose_id"), *place, *off, suspect}, mm_in(one, "expected_mm")});
  }
  if (poses.empty()) return "";
  std::vector<DrawnPose> drawn;
  for (const Row& one : poses) drawn.push_back(one.drawn);
  std::stable_sort(poses.begin(), poses.end(), [](const Row& a, const Row& b) {
    return a.drawn.off_mm.norm() > b.drawn.off_mm.norm();
  });
  std::vector<HtmlRow> rows;
  for (const Row& one : poses) {
    const Vector3& off = one.drawn.off_mm;
    rows.push_back(
        {{html_text(one.drawn.name), fmt::format("{:.4f}", off.x()), fmt::format("{:.4f}", off.y()),
          fmt::format("{:.4f}", off.z()), fmt::format("{:.4f} mm", off.norm()), one.expected,
          one.drawn.marked ? "fits nothing, left out: measure it again" : ""},
         one.drawn.marked ? "changed" : ""});
  }
  return html_section("The poses",
                      pose_picture(drawn) + html_table({"numbers flows",
                                                        {"pose", "dx, mm", "dy, mm", "dz, mm",
                                                         "off by", "of a healthy robot, rms", ""},
                                                        rows}));
}

/// `<span class="badge good">healthy</span>`
std::string badge_of(const std::string& verdict) {
  const char* kind = verdict == "healthy" ? " good" : verdict == "changed" ? " bad" : " soon";
  return verdict.empty()
             ? ""
             : fmt::format("<span class=\"badge{}\">{}</span>", kind, html_text(verdict));
}

}  // namespace

std::string health_sections(const std::string& findings, const std::string& links) {
  const json found = json::parse(findings, nullptr, false);
  std::string verdict = text_in(found, "verdict");
  std::replace(verdict.begin(), verdict.end(), '_', ' ');
  return html_section("Verdict",
                      fmt::format("<p class=\"verdict\">{}{}</p>\n{}\n", badge_of(verdict),
                                  html_text(text_in(found, "why")), links) +
                          figures(found)) +
         html_section("What changed", changes(found)) + poses_of_check(found) +
         html_section("Hardest to see", hardest_to_see(found));
}

std::string health_page(const std::string& findings, const HealthPageOf& of) {
  const json found = json::parse(findings, nullptr, false);
  std::string subtitle = fmt::format("batch {} · checked {}", of.batch, shown_day(of.at));
  if (of.papers != nullptr)
    subtitle = of.papers->robot.name() + " · " + subtitle +
               papers_text(papers_of(*of.papers).value_or(CellPapers()));
  return plain_page({.mark = {"health", of.cell, text_in(found, "model")},
                     .title = fmt::format("Health of cell {}", of.cell),
                     .subtitle = subtitle,
                     .body = health_sections(findings, "")});
}

}  // namespace trammel
