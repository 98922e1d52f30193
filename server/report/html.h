#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace trammel {

/// Text that is shown literally, whatever it holds; terminal control characters are spelled out
/// (plain_text.h).
[[nodiscard]] std::string html_text(std::string_view text);

/// A row of a table; its cells are HTML.
struct HtmlRow {
  std::vector<std::string> cells;
  std::string kind = {};  ///< class for the style sheet; empty: none
  int last_spans = 1;     ///< columns that the last cell takes
};
[[nodiscard]] std::string html_rows(const std::vector<HtmlRow>& rows);

/// A table. With `stacks` in its kind, each cell has a line of its own on narrow screens, behind
/// the name of its column; with `flows` the cells follow each other like words. Other kinds stay
/// tables.
struct HtmlTable {
  std::string kind = {};          ///< classes for the style sheet; empty: none
  std::vector<std::string> head;  ///< empty: no row of names
  std::vector<HtmlRow> rows;
};
[[nodiscard]] std::string html_table(const HtmlTable& table);
/// A section with a heading; `body` is HTML.
[[nodiscard]] std::string html_section(std::string_view title, std::string_view body);
/// A link; `text` is shown as it stands.
[[nodiscard]] std::string html_link(std::string_view address, std::string_view text);

/// JSON for a script in a page: no text in it can end the script.
[[nodiscard]] std::string script_json(const nlohmann::ordered_json& data);

/// `page` with every `{{name}}` replaced, once. A name without content is a bug.
[[nodiscard]] std::string fill_in(std::string_view page,
                                  const std::map<std::string, std::string, std::less<>>& contents);

}  // namespace trammel
