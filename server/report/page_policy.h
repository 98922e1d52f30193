#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace trammel {

/// The scripts and the style sheets that stand in a page, each the text between its tags. Data in
/// JSON is no script.
struct PageInserts {
  std::vector<std::string> scripts, styles;
};
[[nodiscard]] PageInserts inserts_of(std::string_view page);
/// The inserts of all pages of this program, before values from outside are filled in.
[[nodiscard]] PageInserts inserts_of_our_pages();

/// A Content-Security-Policy that lets exactly these run and apply, and nothing be loaded, sent or
/// framed. A name that got into a page as HTML would do nothing under it.
[[nodiscard]] std::string content_policy(const PageInserts& allowed);

}  // namespace trammel
