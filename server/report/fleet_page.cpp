#include "server/report/fleet_page.h"

#include <algorithm>

#include "server/report/cell_needs.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/plain_page.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

const ordered_json& member(const ordered_json& object, const char* key) {
  static const ordered_json kNone;
  return object.is_object() && object.contains(key) ? object[key] : kNone;
}

std::string text_in(const ordered_json& object, const char* key) {
  const ordered_json& value = member(object, key);
  return value.is_string() ? value.get<std::string>() : "";
}

std::string or_dash(const std::string& text) { return text.empty() ? "–" : html_text(text); }

std::string verdict_of(const ordered_json& cell) {
  std::string verdict = text_in(member(cell, "health"), "verdict");
  std::replace(verdict.begin(), verdict.end(), '_', ' ');
  return verdict.empty() ? "not checked yet" : verdict;
}

/// The comparison with robots of its type.
std::string twins_of(const ordered_json& cell) {
  if (!cell.is_object() || !cell.contains("unlike_twins")) return "no model in force";
  const ordered_json& unlike = cell["unlike_twins"];
  if (!unlike.is_array()) return "too few robots of its type to compare each of its parameters";
  if (unlike.empty()) return "like its twins";
  std::string list;
  for (const ordered_json& one : unlike)
    list += "<li>" + html_text(text_in(one, "sentence")) + "</li>";
  return "unlike its twins:<ul>" + list + "</ul>";
}

/// The lines of its error budget that differ from those of robots of its type.
std::string lines_of(const ordered_json& cell) {
  const ordered_json& lines = member(cell, "lines_among_sisters");
  if (!lines.is_array()) return "–";
  std::string list;
  for (const ordered_json& line : lines) {
    const ordered_json& differs = member(line, "differs");
    if (differs.is_boolean() && differs.get<bool>())
      list += "<li>" + html_text(text_in(line, "sentence")) + "</li>";
  }
  return list.empty() ? "none" : "<ul>" + list + "</ul>";
}

/// `<badge> Its check was due by 2026-11-20. To do: ...`
std::string need_of_row(const ordered_json& cell) {
  const ordered_json& need = member(cell, "need");
  const std::string action = text_in(need, "action");
  if (text_in(need, "sentence").empty()) return "–";
  return need_badge(text_in(need, "urgency")) + html_text(text_in(need, "sentence")) +
         (action.empty() ? "" : " <b>To do:</b> " + html_text(action));
}

HtmlRow cell_row(const ordered_json& cell) {
  const std::string verdict = verdict_of(cell);
  const ordered_json& version = member(cell, "version");
  std::string model = or_dash(text_in(cell, "model"));
  if (version.is_number_integer()) model += fmt::format(" (version {})", version.get<int>());
  return {{or_dash(text_in(cell, "cell")), or_dash(text_in(cell, "robot")), model,
           html_text(verdict), need_of_row(cell), or_dash(text_in(member(cell, "health"), "due")),
           twins_of(cell), lines_of(cell)},
          verdict == "changed" ? "changed" : ""};
}

std::string types_text(const ordered_json& types) {
  std::string list;
  for (const ordered_json& type : types) {
    const ordered_json& robots = member(type, "robots");
    if (!robots.is_number_integer()) continue;
    list +=
        fmt::format("<li>{}: {} robots</li>", html_text(text_in(type, "robot")), robots.get<int>());
  }
  return list.empty()
             ? ""
             : html_section("Types that were learned from several robots", "<ul>" + list + "</ul>");
}

}  // namespace

std::string fleet_page(const ordered_json& fleet, std::int64_t at) {
  const ordered_json &cells = member(fleet, "cells"), &types = member(fleet, "types");
  std::vector<HtmlRow> rows;
  std::size_t changed = 0, unchecked = 0;
  for (const ordered_json& cell : cells) {
    rows.push_back(cell_row(cell));
    changed += verdict_of(cell) == "changed" ? 1 : 0;
    unchecked += verdict_of(cell) == "not checked yet" ? 1 : 0;
  }
  const std::string count = fmt::format("{} robot{}", rows.size(), rows.size() == 1 ? "" : "s");
  const std::string verdict = fmt::format(
      "<p class=\"verdict\">{}: {} changed, {} not checked yet.</p>", count, changed, unchecked);
  const std::string table =
      html_table({"stacks",
                  {"cell", "robot", "model", "health", "what it needs", "next check",
                   "among its twins", "lines of the budget that differ"},
                  rows});
  return plain_page({.mark = {"fleet", ""},
                     .title = "Fleet",
                     .subtitle = fmt::format("{} · {}", count, shown_day(at)),
                     .body = html_section("Cells", verdict + table) + types_text(types)});
}

}  // namespace trammel
