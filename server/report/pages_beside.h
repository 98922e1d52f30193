#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// The subject of a page; it is in the page's head, where other pages find it.
struct PageMark {
  std::string_view
      kind;          ///< model, diagnosis, program, health, remedies, comparison, history or fleet
  std::string cell;  ///< empty: of several
  std::string model = {};  ///< id; empty: of none
};
[[nodiscard]] std::string page_mark(const PageMark& mark);

/// `page` with links to the pages beside `path`, its future place, that are of the same cell or of
/// several cells. So readers of the folder find their way between them. Only the marks and file
/// names of these pages enter the page. Pages that are written later are missing. `-`: no links.
[[nodiscard]] std::string with_pages_beside(std::string page, const std::string& path);

}  // namespace trammel
