#pragma once

#include <string>

#include "server/report/pages_beside.h"
#include "server/robot/cell_papers.h"

namespace trammel {

/// A page without scripts, in the style of all pages.
struct PlainPage {
  PageMark mark;
  std::string title, subtitle;  ///< text
  std::string body;             ///< HTML
};
[[nodiscard]] std::string plain_page(const PlainPage& page);

/// ` · serial number 66-40 · measured with AT960 by I. Newton`, as far as the cell file has these
/// data.
[[nodiscard]] std::string papers_text(const CellPapers& papers);

}  // namespace trammel
