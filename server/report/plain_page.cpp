#include "server/report/plain_page.h"

#include <fmt/format.h>

#include "server/report/html.h"
#include "server/report/page_parts.h"

namespace trammel {

std::string plain_page(const PlainPage& page) {
  const std::string title = html_text(page.title);
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{}\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n<h1>{}</h1>\n<p "
      "class=\"subtitle\">{}</p>\n"
      "<nav class=\"beside\"></nav>\n{}\n</main>\n</body>\n</html>\n",
      page_mark(page.mark), title, page_style(), title, html_text(page.subtitle), page.body);
}

std::string papers_text(const CellPapers& papers) {
  std::string text;
  if (!papers.serial_number.empty()) text += " · serial number " + papers.serial_number;
  if (!papers.instrument.empty()) text += " · measured with " + papers.instrument;
  if (!papers.operator_name.empty())
    text += (papers.instrument.empty() ? " · measured by " : " by ") + papers.operator_name;
  return text;
}

}  // namespace trammel
