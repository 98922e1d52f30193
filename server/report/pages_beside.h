#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// The subject of a page; it is in the page's head, where other pages find it.
struct PageMark {
  std::string_view
      kind;  ///< model, diagnosis, program, health, remedies, comparison, history, view or fleet
  std::string cell;        ///< empty: of several
  std::string model = {};  ///< id; empty: of none
};
[[nodiscard]] std::string page_mark(const PageMark& mark);

/// `page` with links to the pages beside `path`, its future place, that are of the same cell or of
/// several cells. So readers of the folder find their way between them. Only the marks and file
/// names of these pages enter the page. `-`: no links. Links that it has already are replaced.
[[nodiscard]] std::string with_pages_beside(std::string page, const std::string& path);

/// After `page` was written to `path`: the pages beside it that lead to it, or should, get their
/// links anew, so that links go both ways. Nothing else of them changes.
void link_pages_beside(const std::string& page, const std::string& path);

}  // namespace trammel
