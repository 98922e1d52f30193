#include "server/report/html.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "server/base/check.h"
#include "server/base/plain_text.h"

namespace trammel {

namespace {

/// A character as HTML spells it.
std::string escaped(char c) {
  switch (c) {
    case '&':
      return "&amp;";
    case '<':
      return "&lt;";
    case '>':
      return "&gt;";
    case '"':
      return "&quot;";
    default:
      return {c};
  }
}

std::string class_of(const std::string& kind) {
  return kind.empty() ? "" : fmt::format(" class=\"{}\"", kind);
}

/// The names of columns that cells are shown behind on narrow pages; empty: none.
std::vector<std::string> names_shown(const HtmlTable& table) {
  const auto is = [&](const char* kind) { return table.kind.find(kind) != std::string::npos; };
  if (!is("stacks") && !is("flows")) return {};
  std::vector<std::string> names = table.head;
  if (is("flows")) names.front().clear();  // the heading of its row
  return names;
}

std::string name_of(const std::vector<std::string>& names, std::size_t column, bool spans) {
  const bool named = column < names.size() && !spans && !names[column].empty();
  return named ? fmt::format(" data-name=\"{}\"", names[column]) : "";
}

std::string rows_of(const std::vector<HtmlRow>& rows, const std::vector<std::string>& names) {
  std::string html;
  for (const HtmlRow& row : rows) {
    html += fmt::format("<tr{}>", class_of(row.kind));
    for (std::size_t k = 0; k < row.cells.size(); ++k) {
      const bool spans = row.last_spans > 1 && k + 1 == row.cells.size();
      html +=
          fmt::format("<td{}{}>{}</td>", name_of(names, k, spans),
                      spans ? fmt::format(" colspan=\"{}\"", row.last_spans) : "", row.cells[k]);
    }
    html += "</tr>\n";
  }
  return html;
}

}  // namespace

std::string html_text(std::string_view text) {
  std::string html;
  for (const char c : shown_lines(text)) html += escaped(c);
  return html;
}

std::string html_rows(const std::vector<HtmlRow>& rows) { return rows_of(rows, {}); }

std::string html_table(const HtmlTable& table) {
  if (table.head.empty())
    return fmt::format("<table{}>\n{}</table>", class_of(table.kind), html_rows(table.rows));
  return fmt::format("<table{}>\n<thead><tr><th>{}</th></tr></thead>\n<tbody>\n{}</tbody></table>",
                     class_of(table.kind), fmt::join(table.head, "</th><th>"),
                     rows_of(table.rows, names_shown(table)));
}

std::string html_section(std::string_view title, std::string_view body) {
  return fmt::format("<section>\n<h2>{}</h2>\n{}\n</section>\n", html_text(title), body);
}

std::string html_link(std::string_view address, std::string_view text) {
  return fmt::format("<a href=\"{}\">{}</a>", html_text(address), html_text(text));
}

std::string script_json(const nlohmann::ordered_json& data) {
  std::string text = data.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at)) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

std::string fill_in(std::string_view page,
                    const std::map<std::string, std::string, std::less<>>& contents) {
  std::string filled;
  while (true) {
    const std::size_t open = page.find("{{");
    filled += page.substr(0, open);
    if (open == std::string_view::npos) return filled;
    const std::size_t close = page.find("}}", open);
    TRAMMEL_CHECK(close != std::string_view::npos);
    const auto content = contents.find(page.substr(open + 2, close - open - 2));
    TRAMMEL_CHECK(content != contents.end());
    filled += content->second;
    page.remove_prefix(close + 2);
  }
}

}  // namespace trammel
