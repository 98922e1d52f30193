#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// The subject of a page; it stands in its head, so that other pages find it.
struct PageMark {
  std::string_view
      kind;          ///< model, diagnosis, program, health, remedies, comparison, history or fleet
  std::string cell;  ///< empty: of several
  std::string model = {};  ///< id; empty: of none
};
[[nodiscard]] std::string page_mark(const PageMark& mark);

/// `page` with links to the pages that stand beside `path`, where it is going to be written, and
/// are of the same cell or of several: whoever has the folder finds from one to the other. Nothing
/// of them but their marks and file names gets into the page. A page that is written later is not
/// known to this one. `-`: no links.
[[nodiscard]] std::string with_pages_beside(std::string page, const std::string& path);

}  // namespace trammel
