#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace trammel {

/// Text that shows as it stands, whatever it holds; what controls a terminal is spelled out (plain_text.h).
[[nodiscard]] std::string html_text(std::string_view text);

/// A row of a table; its cells are HTML.
struct HtmlRow {
  std::vector<std::string> cells;
  std::string kind = {};  ///< class for the style sheet; empty: none
  int last_spans = 1;     ///< columns that the last cell takes
};
[[nodiscard]] std::string html_rows(const std::vector<HtmlRow>& rows);
/// The row of names above a table.
[[nodiscard]] std::string html_head(const std::vector<std::string>& names);

struct HtmlTable {
  std::string kind = {};          ///< class for the style sheet; empty: none
  std::vector<std::string> head;  ///< empty: no row of names
  std::vector<HtmlRow> rows;
};
[[nodiscard]] std::string html_table(const HtmlTable& table);

/// JSON inside a script of a page: no text in it can end the script.
[[nodiscard]] std::string script_json(const nlohmann::ordered_json& data);

/// `page` with every `{{name}}` replaced, once. A name without content is a bug.
[[nodiscard]] std::string fill_in(std::string_view page,
                                  const std::map<std::string, std::string, std::less<>>& contents);

}  // namespace trammel
