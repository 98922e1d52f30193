#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

/// Pages looked at with a real browser.
namespace trammel::test {

constexpr const char* kBrowser = "/usr/bin/chromium";
inline bool has_browser() { return std::filesystem::exists(kBrowser); }

/// Runs in the page: says of each canvas how many of its pixels have a colour that is none of text
/// and grid, what went wrong, and how far the page is wider than its window.
constexpr const char* kLookAtIt = R"(<script>
window.addEventListener("load", () => {
  const coloured = canvas => {
    const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      const [r, g, b, a] = pixels.slice(i, i + 4);
      if (a > 100 && Math.max(r, g, b) - Math.min(r, g, b) > 45) ++count;
    }
    return count;
  };
  const seen = [...document.querySelectorAll("canvas")].map(c => `${c.id} ${coloured(c)}`);
  seen.push(`page-too-wide ${document.documentElement.scrollWidth - document.documentElement.clientWidth}`);
  seen.push(`errors ${window.wentWrong}`);
  const text = document.createElement("pre");
  text.id = "seen";
  text.textContent = seen.join("\n") + "\n";
  document.body.append(text);
});
</script>)";
constexpr const char* kListen =
    R"(<script>window.wentWrong = 0; window.onerror = () => ++window.wentWrong;</script>)";

/// What a browser of that width finds on the page: a number a name.
inline std::map<std::string, int> seen_by_browser(std::string page, int width) {
  const TemporaryFolder folder;
  page.replace(page.find("<head>"), 6, std::string("<head>") + kListen);
  page.replace(page.rfind("</body>"), 7, std::string(kLookAtIt) + "</body>");
  const std::string file = folder.write("page.html", page);
  const Finished browser =
      run({kBrowser, "--headless=new", "--no-sandbox", "--disable-gpu",
           "--virtual-time-budget=5000", fmt::format("--window-size={},900", width),
           "--user-data-dir=" + folder.file("profile"), "--dump-dom", "file://" + file});
  const std::string opening = "<pre id=\"seen\">";
  const std::size_t from = browser.out.find(opening);
  EXPECT_NE(from, std::string::npos) << browser.err;
  std::map<std::string, int> seen;
  if (from == std::string::npos) return seen;
  std::istringstream text(browser.out.substr(from + opening.size()));
  std::string name;
  for (int number = 0; text >> name >> number;) seen[name] = number;
  return seen;
}

/// The page as its scripts leave it.
inline std::string dom_in_browser(const std::string& page) {
  const TemporaryFolder folder;
  const std::string file = folder.write("page.html", page);
  return run({kBrowser, "--headless=new", "--no-sandbox", "--disable-gpu",
              "--virtual-time-budget=5000", "--user-data-dir=" + folder.file("profile"),
              "--dump-dom", "file://" + file})
      .out;
}

/// Sheets of paper that the page takes.
inline int pages_on_paper(const std::string& page) {
  const TemporaryFolder folder;
  const std::string file = folder.write("page.html", page), pdf = folder.file("page.pdf");
  const Finished browser =
      run({kBrowser, "--headless", "--no-sandbox", "--disable-gpu",
           "--user-data-dir=" + folder.file("profile"), "--print-to-pdf=" + pdf, "file://" + file});
  std::ifstream in(pdf, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(in), {}};
  EXPECT_FALSE(all.empty()) << browser.err;
  int pages = 0;
  for (auto at = all.find("/Type /Page\n"); at != std::string::npos;
       at = all.find("/Type /Page\n", at + 1))
    ++pages;
  return pages;
}

}  // namespace trammel::test
