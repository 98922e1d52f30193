#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// libtrammel as programs of others meet it: installed, found by find_package(Trammel), and nothing
// of its inside in sight.

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kLibraryLimit{15};

std::string output_of(const std::vector<std::string>& command) {
  const test::Finished finished = test::run(command, kLibraryLimit);
  EXPECT_EQ(finished.exit_code, 0) << command[0] << " " << command[1] << ":\n"
                                   << finished.out << finished.err;
  return finished.out;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The files that libtrammel0.1, libtrammel-dev and trammel would install, and the examples
/// built from that alone.
class Library : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (!is_built()) return;
    prefix_ = new test::TemporaryFolder();
    for (const char* component : {"library", "dev", "trammel"}) {
      output_of({"/usr/bin/cmake", "--install", TRAMMEL_BINARY_DIR, "--prefix",
                 prefix_->path().string(), "--component", component});
    }
    build_ = fs::path(TRAMMEL_BINARY_DIR) /
             "tests/package/examples";  // it stays at its place, for ccache's sake
    fs::remove_all(build_);
    output_of({"/usr/bin/cmake", "-GNinja", "-DCMAKE_BUILD_TYPE=Release", "-S", examples().string(),
               "-B", build_.string(), "-DCMAKE_PREFIX_PATH=" + prefix_->path().string()});
    output_of({"/usr/bin/cmake", "--build", build_.string()});
  }
  static void TearDownTestSuite() {
    delete prefix_;
    prefix_ = nullptr;
  }

  void SetUp() override {
    if (!is_built()) GTEST_SKIP() << "libtrammel is not in this build";
  }

  static bool is_built() { return fs::exists(TRAMMEL_BINARY_DIR "/clients/library/libtrammel.so"); }
  static fs::path installed(const std::string& path) { return prefix_->path() / path; }
  static fs::path examples() { return installed("share/doc/libtrammel-dev/examples"); }
  static fs::path shared_library() { return installed("lib/libtrammel.so"); }

  inline static test::TemporaryFolder* prefix_ = nullptr;
  inline static fs::path build_;
};

TEST_F(Library, ItsExampleCorrectsATargetWithAModelOfTheInstalledProgram) {
  const std::string trammel = installed("bin/trammel").string(),
                    data = installed("share/trammel").string();
  const test::TemporaryFolder folder;
  const std::string cell = data + "/config/cell-7.yaml", plan = folder.file("plan.csv"),
                    batch = folder.file("batch.csv"), model = folder.file("a.model");
  output_of({trammel, "plan", "--cell", cell, "--count", "60", "-o", plan});
  output_of({trammel, "simulate", "--cell", cell, "--truth", data + "/models/truth/chapter-5.yaml",
             "--plan", plan, "-o", batch});
  output_of({trammel, "train", "--cell", cell, "--batch", batch, "--bias", "none", "-o", model});
  const std::string said = output_of({(build_ / "offline").string(), model});
  EXPECT_TRUE(std::regex_search(said, std::regex("(ok|out_of_domain): command x [0-9.]+ mm")))
      << said;
}

TEST_F(Library, ItsExampleSaysWhatIsWrongWithAModel) {
  const test::Finished refused =
      test::run({(build_ / "offline").string(), "/nowhere.model"}, kLibraryLimit);
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.out.find("/nowhere.model"), std::string::npos) << refused.out;
}

TEST_F(Library, ItsExampleAsksADaemon) {
  test::Daemon daemon;
  daemon.start();
  EXPECT_EQ(output_of({(build_ / "service").string(), std::to_string(daemon.port()),
                       std::to_string(daemon.domain())}),
            "cell-7: not_found\n");
}

// Fast DDS dates what it sends by the host's clock, and for a time before 1970 it counts for ever.
TEST_F(Library, AProgramOfOthersIsAnsweredThoughItsHostsClockStandsBefore1970) {
  test::Daemon daemon;
  daemon.start();
  const test::TemporaryFolder folder;
  const std::int64_t moved = -100LL * 365 * 24 * 3600;  // s
  const std::string clock =
      folder.write("clock", std::string(reinterpret_cast<const char*>(&moved), sizeof moved));
  const test::Finished asked = test::run(
      {"/usr/bin/env", "LD_PRELOAD=" TRAMMEL_BINARY_DIR "/tests/libtrammel_moved_clock.so",
       "TRAMMEL_TEST_CLOCK=" + clock, (build_ / "service").string(), std::to_string(daemon.port()),
       std::to_string(daemon.domain())},
      std::chrono::seconds(60));
  EXPECT_EQ(asked.out, "cell-7: not_found\n") << asked.err;
}

TEST_F(Library, ItsExamplesAreShort) {
  for (const auto& entry : fs::directory_iterator(examples())) {
    EXPECT_LT(lines_of(test::read_file(entry.path().string())).size(), 40u) << entry.path();
  }
}

TEST_F(Library, ItsHeadersNeedTheStandardLibraryAndExpectedOnly) {
  const std::regex include("^#include [<\"](.*)[>\"]");
  int headers = 0;
  for (const auto& entry : fs::directory_iterator(installed("include/trammel"))) {
    ++headers;
    for (const std::string& line : lines_of(test::read_file(entry.path().string()))) {
      std::smatch found;
      if (!std::regex_search(line, found, include)) continue;
      const std::string header = found[1];
      const bool ours = header.starts_with("trammel/"),
                 standard = header.find_first_of("./") == std::string::npos;
      EXPECT_TRUE(ours || standard || header == "tl/expected.hpp")
          << entry.path() << ": " << header;
    }
  }
  EXPECT_EQ(headers, 5);
}

TEST_F(Library, ItShowsItsOwnNamesAndNoOthers) {
  std::set<std::string> others;
  int own = 0;
  for (const std::string& line :
       lines_of(output_of({"/usr/bin/nm", "-DC", "--defined-only", shared_library().string()}))) {
    const std::string name = line.substr(std::min<std::size_t>(19, line.size()));
    if (name.starts_with("trammel::api::")) {
      ++own;
    } else if (!name.starts_with("TRAMMEL_") && !name.starts_with("CODEABI_")) {
      others.insert(name.substr(0, name.find('@')));
    }
  }
  EXPECT_GT(own, 30);
  EXPECT_EQ(others,
            std::set<std::string>{
                "eprosima::fastrtps::rtps::Time_t::now(eprosima::fastrtps::rtps::Time_t&)"});
}

TEST_F(Library, ItsFileSaysWhichProgramsCanUseIt) {
  EXPECT_NE(output_of({"/usr/bin/readelf", "-d", shared_library().string()})
                .find("soname: [libtrammel.so.0.1]"),
            std::string::npos);
}

TEST_F(Library, EveryNameInItsHeadersIsExplained) {
  if (test::run({"/usr/bin/env", "doxygen", "--version"}, kLibraryLimit).exit_code == 127)
    GTEST_SKIP() << "no doxygen here";
  const test::TemporaryFolder folder;
  const std::string settings = folder.write(
      "Doxyfile",
      "@INCLUDE = " TRAMMEL_SOURCE_DIR "/clients/library/Doxyfile\nINPUT = " TRAMMEL_SOURCE_DIR
      "/clients/library/trammel " TRAMMEL_SOURCE_DIR
      "/server/exchange/values.h\nGENERATE_HTML = NO\nGENERATE_XML = YES\nOUTPUT_DIRECTORY = " +
          folder.path().string() + "\n");
  const test::Finished complaints = test::run({"/usr/bin/env", "doxygen", settings}, kLibraryLimit);
  EXPECT_EQ(complaints.exit_code, 0);
  EXPECT_EQ(complaints.err, "");
}

}  // namespace
}  // namespace trammel
