#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

// The Debian packages of this build. Installing, upgrading and purging them on a clean root:
// deploy/check packages.

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kDebianLimit{15};

bool is_here(const std::string& program) {
  return test::run({"/bin/sh", "-c", "command -v " + program}, kDebianLimit).exit_code == 0;
}

/// Built once, from what is built; skipped with what is missing.
class Debian : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    for (const char* needed : {"dh", "dh_python3", "dpkg-buildpackage"}) {
      if (!is_here(needed)) missing_ = needed;
    }
    if (!missing_.empty()) return;
    // Quick to pack: what is looked at is what is inside.
    const test::Finished made = test::run(
        {"/usr/bin/env", "TRAMMEL_XZ=0", TRAMMEL_SOURCE_DIR "/deploy/package", TRAMMEL_BINARY_DIR},
        kDebianLimit);
    EXPECT_EQ(made.exit_code, 0) << made.out << made.err;
  }
  void SetUp() override {
    if (!missing_.empty())
      GTEST_SKIP() << "no " << missing_ << " here (packages debhelper, dh-python)";
  }

  /// The path of a package's file.
  static std::string package(const std::string& name) {
    for (const auto& entry : fs::directory_iterator(folder())) {
      const bool is_package = entry.path().extension() == ".deb";
      if (is_package && entry.path().filename().string().starts_with(name + "_"))
        return entry.path().string();
    }
    ADD_FAILURE() << "there is no package " << name;
    return "";
  }
  static fs::path folder() { return fs::path(TRAMMEL_BINARY_DIR) / "packages"; }

  static std::string about(const std::string& package_name, const std::string& option) {
    const test::Finished said =
        test::run({"/usr/bin/dpkg-deb", option, package(package_name)}, kDebianLimit);
    EXPECT_EQ(said.exit_code, 0) << said.err;
    return said.out;
  }
  static void expect_files(const std::string& package_name, const std::vector<std::string>& paths) {
    const std::string listing = about(package_name, "-c");
    for (const std::string& path : paths) {
      EXPECT_TRUE(std::regex_search(listing, std::regex(" \\./" + path + "( -> .*)?\n")))
          << package_name << ": " << path;
    }
  }

  /// True if libtrammel and the Python package are in this build.
  static bool has_library() {
    return fs::exists(TRAMMEL_BINARY_DIR "/clients/library/libtrammel.so");
  }
  static bool has_python() {
    return has_library() && fs::exists(TRAMMEL_BINARY_DIR "/clients/python/trammel/py.typed");
  }
  static std::vector<std::string> names() {
    std::vector<std::string> names = {"trammel", "trammeld"};
    if (has_library()) names.insert(names.end(), {"libtrammel0.1", "libtrammel-dev"});
    if (has_python()) names.emplace_back("python3-trammel");
    return names;
  }

  inline static std::string missing_;
};

TEST_F(Debian, EachPackageHasItsFiles) {
  expect_files("trammel", {"usr/bin/trammel", "usr/share/trammel/config/cell-7\\.yaml",
                           "usr/share/trammel/models/truth/chapter-5\\.yaml",
                           "usr/share/doc/trammel/copyright"});
  expect_files(
      "trammeld",
      {"usr/bin/trammeld", "usr/libexec/trammel/supervise", "etc/trammel/server\\.yaml",
       "etc/trammel/cell-7\\.yaml", "etc/logrotate\\.d/trammeld",
       "lib/systemd/system/trammeld\\.service", "lib/systemd/system/trammel-discovery@\\.service",
       "usr/share/trammel/discovery-server\\.xml", "usr/share/man/man8/trammeld\\.8\\.gz"});
}

TEST_F(Debian, TheDaemonsManualHasEveryOption) {
  std::string manual = test::read_file(TRAMMEL_SOURCE_DIR "/deploy/debian/trammeld.8");
  manual.erase(std::remove(manual.begin(), manual.end(), '\\'), manual.end());
  const std::string help =
      test::run({TRAMMEL_BINARY_DIR "/server/trammeld", "--help"}, kDebianLimit).out;
  static const std::regex kOption("--[a-z-]+");
  int options = 0;
  for (auto at = std::sregex_iterator(help.begin(), help.end(), kOption);
       at != std::sregex_iterator(); ++at) {
    if (at->str() == "--help") continue;
    ++options;
    EXPECT_NE(manual.find(at->str()), std::string::npos) << at->str();
  }
  EXPECT_GE(options, 6);
}

TEST_F(Debian, LibrariesHaveTheirFiles) {
  if (!has_library()) GTEST_SKIP() << "libtrammel is not in this build";
  expect_files("libtrammel0.1", {"usr/lib/libtrammel\\.so\\.0\\.1"});
  expect_files("libtrammel-dev",
               {"usr/lib/libtrammel\\.so", "usr/include/trammel/offline\\.h",
                "usr/include/trammel/service\\.h", "usr/lib/cmake/trammel/TrammelConfig\\.cmake"});
  EXPECT_TRUE(
      std::regex_search(about("libtrammel-dev", "-I"), std::regex("Depends:.*libexpected-dev")));
  EXPECT_FALSE(
      std::regex_search(about("libtrammel-dev", "-I"), std::regex("Depends:.*(eigen|fastrtps)")));
  if (!has_python()) GTEST_SKIP() << "the Python package is not in this build";
  expect_files("python3-trammel", {"usr/lib/python3/dist-packages/trammel/__init__\\.py",
                                   "usr/lib/python3/dist-packages/trammel/py\\.typed"});
  EXPECT_TRUE(
      std::regex_search(about("python3-trammel", "-I"), std::regex("Depends:.* libtrammel0\\.1 ")));
  EXPECT_TRUE(std::regex_search(about("python3-trammel", "-I"),
                                std::regex("Depends:.* python3 ?\\(<< 3\\.")));
}

TEST_F(Debian, TheVersionIsThatOfTheProgram) {
  const test::Finished version =
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "--version"}, kDebianLimit);
  std::smatch number;
  ASSERT_TRUE(std::regex_search(version.out, number, std::regex("[0-9]+\\.[0-9]+\\.[0-9]+")))
      << version.out;
  for (const std::string& name : names()) {
    EXPECT_NE(about(name, "-I").find("Version: " + number.str() + "-"), std::string::npos) << name;
  }
}

TEST_F(Debian, WhatAHostConfiguresIsKeptOnUpgrades) {
  const test::TemporaryFolder control;
  ASSERT_EQ(test::run({"/usr/bin/dpkg-deb", "-e", package("trammeld"), control.path().string()},
                      kDebianLimit)
                .exit_code,
            0);
  EXPECT_EQ(
      test::read_file(control.file("conffiles")),
      "/etc/logrotate.d/trammeld\n/etc/trammel/cell-7.yaml\n/etc/trammel/discovery-server.xml\n"
      "/etc/trammel/server.yaml\n");
}

TEST_F(Debian, TheDaemonComesWithItsCommandLine) {
  EXPECT_TRUE(std::regex_search(about("trammeld", "-I"), std::regex("Depends:.* trammel \\(= ")));
}

TEST_F(Debian, LintianFindsNoError) {
  if (!is_here("lintian")) GTEST_SKIP() << "no lintian here";
  std::vector<std::string> command = {"/usr/bin/lintian", "--allow-root", "--fail-on", "error"};
  for (const auto& entry : fs::directory_iterator(folder())) {
    if (entry.path().extension() == ".deb") command.push_back(entry.path().string());
  }
  const test::Finished found = test::run(command, kDebianLimit);
  EXPECT_EQ(found.exit_code, 0) << found.out << found.err;
}

void put_everywhere(std::string& text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos;
       at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
}

TEST_F(Debian, SystemdTakesTheUnitsAndFindsThemHardlyExposed) {
  if (!is_here("systemd-analyze")) GTEST_SKIP() << "no systemd-analyze here";
  const test::TemporaryFolder root;
  ASSERT_EQ(test::run({"/usr/bin/dpkg-deb", "-x", package("trammeld"), root.path().string()},
                      kDebianLimit)
                .exit_code,
            0);
  // Its programs are where the package was unpacked, not where it will be installed; one is of a
  // package that it only suggests.
  const std::string here = root.path().string();
  const std::vector<std::pair<std::string, std::string>> programs = {
      {"/usr/libexec/trammel/supervise", here + "/usr/libexec/trammel/supervise"},
      {"/usr/bin/trammeld", here + "/usr/bin/trammeld"},
      {"/usr/bin/fast-discovery-server", "/bin/true"}};
  for (const std::string name : {"trammeld.service", "trammel-discovery@.service"}) {
    const std::string unit = root.file("lib/systemd/system/" + name);
    std::string text = test::read_file(unit);
    for (const auto& [installed, present] : programs) put_everywhere(text, installed, present);
    const test::Finished verified = test::run(
        {"/usr/bin/systemd-analyze", "verify", "--man=no", root.write(name, text)}, kDebianLimit);
    EXPECT_EQ(verified.exit_code, 0) << name << ": " << verified.err;
    EXPECT_EQ(verified.err.find("trammel"), std::string::npos) << verified.err;
    const test::Finished exposed =
        test::run({"/usr/bin/systemd-analyze", "security", "--offline=yes", "--threshold=20",
                   "--no-pager", unit},
                  kDebianLimit);
    EXPECT_EQ(exposed.exit_code, 0)
        << exposed.out << exposed.err;  // 20 stands for an exposure of 2.0
  }
}

}  // namespace
}  // namespace trammel
