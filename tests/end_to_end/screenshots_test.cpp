// Every page of a real, small run, looked at by a real browser at three sizes. The pictures stay in
// tests/screenshots/ of the build tree.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/http_client.h"
#include "tests/support/virtual_cell.h"
#include "tests/support/web_browser.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::array<int, 3> kWidths = {400, 800, 1400};  // px: a telephone, a tablet, a desk
constexpr int kHighest = 16000;                           // px of a picture
constexpr std::size_t kHeaviest = 1'500'000;              // bytes of a page
constexpr std::chrono::minutes kScreenshotsLimit{2};
const fs::path kPictures = TRAMMEL_BINARY_DIR "/tests/screenshots";

/// Of a page: what stands out of its window, what is drawn on each canvas, where its links lead. A
/// canvas that holds few coloured points, or all of them in a corner, as axes stand, is empty.
constexpr const char* kLook = R"(
  const coloured = canvas => {
    const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0, left = 1, right = 0, top = 1, bottom = 0;
    for (let i = 0; i < pixels.length; i += 4) {
      if (pixels[i + 3] <= 100) continue;
      const r = pixels[i], g = pixels[i + 1], b = pixels[i + 2];
      if (Math.max(r, g, b) - Math.min(r, g, b) <= 45) continue;
      const x = i / 4 % canvas.width / canvas.width, y = Math.floor(i / 4 / canvas.width) / canvas.height;
      left = Math.min(left, x); right = Math.max(right, x); top = Math.min(top, y); bottom = Math.max(bottom, y);
      ++count;
    }
    return Math.max(right - left, bottom - top) > 0.4 ? count : 0;
  };
  const root = document.documentElement;
  const scrolls = e => e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== "visible" && e.clientWidth > 0;
  return {
    title: document.title, height: root.scrollHeight, wide: root.scrollWidth - root.clientWidth,
    cut: [...document.querySelectorAll("section, div")].filter(scrolls).map(e => e.className + ": " + e.innerText.slice(0, 40)),
    canvases: Object.fromEntries([...document.querySelectorAll("canvas")].map(c => [c.id, coloured(c)])),
    links: [...document.querySelectorAll("a")].map(a => a.getAttribute("href")),
    text: document.body.innerText
  };)";

/// Lines for a shell that make every page that the command line writes.
constexpr const char* kRun = R"(
set -euo pipefail
measured() { trammel simulate --cell cell.yaml --truth "$TRUTH" --plan "$1" --seed "$2" -o "$3"; }
trammel plan --cell cell.yaml --count 70 -o plan.csv
measured plan.csv 1 batch.csv
trammel plan --cell cell.yaml --count 30 --seed 2 -o fresh-plan.csv
measured fresh-plan.csv 2 fresh.csv
trammel train --cell cell.yaml --batch batch.csv --validation-share 0.3 --bias se -o cell.model
trammel train --cell cell.yaml --batch batch.csv --batch fresh.csv --bias none -o second.model
trammel plan --cell cell.yaml --check 12 -o few-plan.csv
measured few-plan.csv 3 few.csv
trammel diagnose --cell cell.yaml --batch batch.csv --report diagnosis.html
trammel report --model cell.model -o model.html
trammel report --model second.model --batch fresh.csv -o model-and-batch.html
trammel check --model cell.model --batch few.csv --report health.html
trammel history --model cell.model --model second.model -o history.html
trammel fleet --model cell.model --model second.model --report fleet.html
trammel view --cell cell.yaml plan.csv -o view.html
trammel correct --model cell.model "$PROGRAM" -o corrected.mod --tolerance 0.2 --report program.html
)";

std::string spelled(const std::string& text) {
  std::string name;
  for (const char c : text)
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' ? c : '_';
  return name;
}

/// A page that was looked at.
struct Seen {
  std::string address, name;
  std::size_t bytes = 0;
};

class Screenshots : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::WebBrowser::is_there()) GTEST_SKIP() << "no chromedriver (package chromium-driver)";
    fs::create_directories(kPictures);
    browser_.emplace();
  }
  /// At three sizes: nothing complains, stands out of the window, or is empty. Returns its links.
  std::set<std::string> look_at(const Seen& page) {
    SCOPED_TRACE(page.address);
    EXPECT_GT(page.bytes, 500u);
    EXPECT_LE(page.bytes, kHeaviest);
    std::set<std::string> links;
    for (const int width : kWidths) {
      SCOPED_TRACE(width);
      browser_->resize(width, 900);
      browser_->open(page.address);
      const json seen = browser_->run(kLook);
      expect_sound(seen, width);
      if (!seen.is_object()) return links;
      for (const json& link : seen.value("links", json::array()))
        links.insert(link.get<std::string>());
      keep_picture(page, width, seen.value("height", 900));
    }
    EXPECT_EQ(browser_->complaints(), std::vector<std::string>());
    return links;
  }

 private:
  static void expect_sound(const json& seen, int width) {
    ASSERT_TRUE(seen.is_object());
    EXPECT_FALSE(seen["title"].get<std::string>().empty());
    EXPECT_LE(seen["wide"].get<int>(), 0) << "wider than its window";
    EXPECT_EQ(seen["cut"], json::array()) << "only seen by scrolling aside";
    for (const auto& [canvas, points] : seen["canvases"].items())
      EXPECT_GT(points.get<int>(), 60) << canvas << " is empty";
    const std::string text = seen["text"];
    for (const char* wrong : {"undefined", "NaN", "{{", "[object", " um ", "[nan]"})
      EXPECT_EQ(text.find(wrong), std::string::npos)
          << wrong << " at " << text.substr(text.find(wrong) - 20, 60);
    static const std::regex kDay("20[0-9]{2}-[01][0-9]-[0-3][0-9]");
    EXPECT_TRUE(std::regex_search(text, kDay)) << "no date at " << width;
  }
  void keep_picture(const Seen& page, int width, int height) {
    browser_->resize(width, std::min(std::max(height, 400), kHighest));
    const std::string picture = browser_->screenshot();
    ASSERT_GT(picture.size(), 4000u);
    EXPECT_EQ(picture.substr(1, 3), "PNG");
    std::ofstream(kPictures / fmt::format("{}-{}.png", page.name, width), std::ios::binary)
        << picture;
  }

  std::optional<test::WebBrowser> browser_;
};

class PagesOfFiles : public Screenshots {
 protected:
  void SetUp() override {
    Screenshots::SetUp();
    if (IsSkipped()) return;
    std::string cell = test::read_file(test::shipped_cell_file());
    cell.replace(cell.find("../models"), 9, TRAMMEL_SOURCE_DIR "/models");
    folder_.write(
        "cell.yaml",
        cell +
            "serial_number: 66-40123\ninstrument: AT960\noperator: I. Newton\ntolerance_mm: 0.2\n");
    const test::Finished made = test::run(
        {"/usr/bin/env", "-C", folder_.path(),
         "TRAMMEL_DEFAULTS=", "PATH=" TRAMMEL_BINARY_DIR "/clients:/usr/bin:/bin",
         "TRUTH=" TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml",
         "PROGRAM=" TRAMMEL_SOURCE_DIR "/config/programs/drill.mod", "/bin/bash", "-c", kRun},
        kScreenshotsLimit);
    ASSERT_EQ(made.exit_code, 0) << made.out << made.err;
  }
  test::TemporaryFolder folder_;
};

TEST_F(PagesOfFiles, AreWholeAtEverySizeDatedAndLinkedToEachOther) {
  std::map<std::string, std::set<std::string>> links;
  for (const char* page :
       {"diagnosis", "model", "model-and-batch", "health", "history", "fleet", "program", "view"}) {
    const std::string file = folder_.file(std::string(page) + ".html");
    links[page] = look_at({"file://" + file, page, fs::file_size(file)});
    for (const std::string& link : links[page]) {
      EXPECT_TRUE(link.starts_with("./")) << page << " leads out of its folder: " << link;
      EXPECT_TRUE(fs::exists(folder_.path() / link.substr(2))) << page << ": " << link;
    }
  }
  for (const char* beside : {"./diagnosis.html", "./health.html", "./view.html", "./program.html"})
    EXPECT_TRUE(links["model"].contains(beside)) << "written later: " << beside;
  for (const char* beside :
       {"./model.html", "./diagnosis.html", "./health.html", "./history.html", "./fleet.html"})
    EXPECT_TRUE(links["program"].contains(beside)) << beside;
  for (const char* page : {"model", "health", "history", "program", "diagnosis"}) {
    const std::string text = test::read_file(folder_.file(std::string(page) + ".html"));
    for (const char* paper : {"66-40123", "AT960", "I. Newton"})
      EXPECT_NE(text.find(paper), std::string::npos) << page << " does not say " << paper;
  }
}

class PagesOfAService : public Screenshots {
 protected:
  void SetUp() override {
    Screenshots::SetUp();
    if (IsSkipped()) return;
    port_ = static_cast<std::uint16_t>(daemon_.port() + 1);
    ASSERT_TRUE(write_text_file(
        daemon_.config_path(),
        test::read_file(daemon_.config_path()) + fmt::format("http: {{port: {}}}\n", port_)));
    daemon_.start();
    folder_.write("batch.csv", test::virtual_batch_csv(60, 1));
    folder_.write("few.csv", test::virtual_batch_csv(12, 5));
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"submit", "--cell", "cell-7", "--batch", "batch.csv", "--watch"},
          {"check", "--service", "--model", "cell-7", "--batch", "few.csv"},
          {"diagnose", "--service", "--cell", "cell-7", "--batch", "batch"}})
      asked(words);
  }
  void asked(const std::vector<std::string>& words) const {
    std::vector<std::string> argv = {"/usr/bin/env", "-C", folder_.path(),
                                     "TRAMMEL_DEFAULTS=", TRAMMEL_BINARY_DIR "/clients/trammel"};
    argv.insert(argv.end(), words.begin(), words.end());
    argv.insert(argv.end(), {"--port", std::to_string(daemon_.port()), "--domain",
                             std::to_string(daemon_.domain()), "--timeout", "60"});
    const test::Finished done = test::run(argv, kScreenshotsLimit);
    EXPECT_LE(done.exit_code.value_or(9), 1) << words[0] << ": " << done.out << done.err;
  }
  [[nodiscard]] std::string address(const std::string& path) const {
    return fmt::format("http://127.0.0.1:{}{}", port_, path);
  }

  test::Daemon daemon_;
  test::TemporaryFolder folder_;
  std::uint16_t port_ = 0;
};

TEST_F(PagesOfAService, AreWholeAtEverySizeAndEveryLinkLeadsToOneOfThem) {
  std::set<std::string> left = {"/"}, seen;
  while (!left.empty()) {
    const std::string path = *left.begin();
    left.erase(left.begin());
    if (!seen.insert(path).second) continue;
    const test::HttpAnswer answer = test::http_get(port_, path);
    EXPECT_EQ(answer.code, 200) << path;
    if (answer.headers.at("Content-Type").starts_with("application/json")) continue;
    EXPECT_EQ(answer.headers.at("Content-Security-Policy").find("unsafe"), std::string::npos)
        << path;
    const std::set<std::string> links =
        look_at({address(path), "service" + spelled(path), answer.body.size()});
    if (path == "/cells/cell-7") {
      for (const char* found : {"/jobs/2/findings", "/jobs/3/findings", "/cells/cell-7/models/1"})
        EXPECT_TRUE(links.contains(found)) << "the cell does not lead to " << found;
    }
    for (const std::string& link : links) {
      EXPECT_TRUE(link.starts_with("/")) << path << " leads to " << link;
      left.insert(link);
    }
  }
  for (const char* path :
       {"/jobs", "/jobs/1", "/jobs/2/findings", "/jobs/3/findings", "/cells/cell-7",
        "/cells/cell-7/models/1", "/cells/cell-7/history", "/fleet"})
    EXPECT_TRUE(seen.contains(path)) << path << " is not reached";
  EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
}

}  // namespace
}  // namespace trammel
