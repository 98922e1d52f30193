#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

// The one rule of the house that a machine holds: who may include whom, who may start a thread, and that nobody sleeps.
// A source tree is a map from path to text, so that the checks themselves are tested on small made-up trees.

namespace trammel {
namespace {

using SourceTree = std::map<std::string, std::string>;
using Complaints = std::vector<std::string>;

/// Lower floors only; siblings never.
const std::map<std::string, int> kFloors = {
    {"server/base", 0},       {"server/robot", 1},    {"server/error_sources", 2}, {"server/measurement", 2},
    {"server/calibrate", 3},  {"server/bias", 3},     {"server/plan", 3},          {"server/simulate", 3},
    {"server/compensate", 4}, {"server/diagnose", 5}, {"server/store", 6},         {"server/registry", 6},
    {"server/report", 6},     {"server/trainer", 7},  {"server/dds", 8},           {"server/http", 8},
    {"server/config", 9},     {"server", 10}};  // server/main.cpp

/// What the folders outside server/ see of our own tree, and the highest floor of server/ with it.
struct Outsider {
  std::set<std::string> folders;
  int highest_floor = 0;
};
const std::map<std::string, Outsider> kOutsiders = {
    {"clients/session", {{"idl"}, 0}},
    {"clients/cam", {{"idl", "clients/session"}, 0}},
    {"clients/cli", {{"clients/session", "clients/cam"}, 7}},
    {"clients", {{"clients/cli"}, -1}},
    {"idl", {{}, 0}},
};

/// Headers of other people's libraries that only some may include.
struct Reserved {
  std::string name;
  std::regex header;
  std::regex may_include;  // paths
};
const std::vector<Reserved> kReserved = {
    {"Fast DDS", std::regex("^(fastdds|fastrtps|fastcdr)/.*"), std::regex("^(server/dds|clients/session|idl)/.*")},
    {"Ceres", std::regex("^ceres/.*"), std::regex("^server/(calibrate|diagnose)/.*")},
    {"yaml-cpp", std::regex("^yaml-cpp/.*"), std::regex("^server/config/.*|^(server|clients)/.*_file\\.(h|cpp)$")},
    {"the YAML reader", std::regex("^server/base/yaml_file\\.h$"),
     std::regex("^server/config/.*|^(server|clients)/.*_file\\.(h|cpp)$")},
    {"SQLite", std::regex("^(sqlite3\\.h|SQLiteCpp/.*)$"), std::regex("^server/store/.*")},
};

const std::set<std::string> kTestFoldersWithoutMirror = {"support", "end_to_end", "benchmarks", "fuzz", "clients"};

std::string folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

bool is_source(std::string_view path) {
  return path.ends_with(".h") || path.ends_with(".cpp") || path.ends_with(".cc");
}

bool is_under(std::string_view path, std::string_view folder) {
  return path.starts_with(folder) && path.substr(folder.size()).starts_with('/');
}

/// Where the comment or literal that starts at `at` ends; `at` itself when none does.
std::size_t end_of_no_code(std::string_view text, std::size_t at) {
  const auto behind = [&](std::size_t found, std::size_t length) {
    return found == std::string_view::npos ? text.size() : found + length;
  };
  const std::string_view rest = text.substr(at);
  if (rest.starts_with("//")) return behind(text.find('\n', at), 0);
  if (rest.starts_with("/*")) return behind(text.find("*/", at + 2), 2);
  if (rest.starts_with("R\"")) {
    const std::string closing = ")" + std::string(rest.substr(2, rest.find('(') - 2)) + "\"";
    return behind(text.find(closing, at), closing.size());
  }
  if (rest.front() != '"' && rest.front() != '\'') return at;
  const bool digit_separator =
      rest.front() == '\'' && at > 0 && std::isxdigit(static_cast<unsigned char>(text[at - 1]));
  if (digit_separator) return at;
  for (std::size_t i = at + 1; i < text.size() && text[i] != '\n'; ++i) {
    if (text[i] == '\\') {
      ++i;
    } else if (text[i] == rest.front()) {
      return i + 1;
    }
  }
  return at;
}

/// The text without comments and literals; lines stay where they are.
std::string code_of(std::string_view text) {
  std::string code;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = end_of_no_code(text, at);
    if (end == at) {
      code += text[at++];
    } else {
      code.append(static_cast<std::size_t>(std::count(text.begin() + at, text.begin() + end, '\n')), '\n');
      at = end;
    }
  }
  return code;
}

struct Include {
  int line = 0;
  std::string header;
};

std::vector<Include> includes_of(const std::string& text) {
  static const std::regex kInclude(R"re(^\s*#\s*include\s*["<]([^">]+)[">].*)re");
  std::vector<Include> includes;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::smatch match;
    if (std::regex_match(line, match, kInclude)) includes.push_back({number, match[1]});
  }
  return includes;
}

/// Why a file in `folder` may not include `header`, a path of our own tree; nothing when it may.
std::optional<std::string> why_not(const std::string& folder, const std::string& header) {
  const std::string target = folder_of(header);
  if (target == folder) return std::nullopt;
  if (folder == "server/config" && header.ends_with("_options.h")) return std::nullopt;
  const auto target_floor = kFloors.find(target);
  if (const auto outsider = kOutsiders.find(folder); outsider != kOutsiders.end()) {
    if (outsider->second.folders.contains(target)) return std::nullopt;
    if (target_floor != kFloors.end() && target_floor->second <= outsider->second.highest_floor) return std::nullopt;
    return target + " is not for " + folder;
  }
  if (target == "idl")
    return folder == "server/dds" ? std::nullopt : std::optional<std::string>("idl is for server/dds");
  if (target_floor == kFloors.end()) return target + " has no floor that the server knows";
  if (target_floor->second < kFloors.at(folder)) return std::nullopt;
  return target + " is on floor " + std::to_string(target_floor->second) + ", " + folder + " on floor " +
         std::to_string(kFloors.at(folder));
}

Complaints check_floors(const SourceTree& tree) {
  Complaints complaints;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    const std::string folder = folder_of(path);
    if (!kFloors.contains(folder) && !kOutsiders.contains(folder)) {
      complaints.push_back(path + ": folder " + folder + " has no floor");
      continue;
    }
    for (const auto& [line, header] : includes_of(text)) {
      const bool ours = header.starts_with("server/") || header.starts_with("clients/") || header.starts_with("idl/") ||
                        header.starts_with("tests/");
      if (!ours) continue;
      if (const auto reason = why_not(folder, header)) {
        complaints.push_back(path + ":" + std::to_string(line) + ": includes " + header + ": " + *reason);
      }
    }
  }
  return complaints;
}

Complaints check_reserved_libraries(const SourceTree& tree) {
  Complaints complaints;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    for (const auto& [line, header] : includes_of(text)) {
      for (const Reserved& reserved : kReserved) {
        if (!std::regex_match(header, reserved.header) || std::regex_match(path, reserved.may_include)) continue;
        complaints.push_back(path + ":" + std::to_string(line) + ": " + reserved.name + " is not for this file");
      }
    }
  }
  return complaints;
}

/// Folders that include each other, however long the way round.
Complaints check_cycles(const SourceTree& tree) {
  std::map<std::string, std::set<std::string>> reaches;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    for (const auto& include : includes_of(text)) {
      const std::string target = folder_of(include.header);
      if (tree.contains(include.header) && target != folder_of(path)) reaches[folder_of(path)].insert(target);
    }
  }
  for (bool grew = true; grew;) {
    grew = false;
    for (auto& [folder, targets] : reaches) {
      const std::set<std::string> known = targets;
      for (const std::string& target : known) {
        if (const auto further = reaches.find(target); further != reaches.end()) {
          targets.insert(further->second.begin(), further->second.end());
        }
      }
      grew = grew || targets.size() != known.size();
    }
  }
  Complaints complaints;
  for (const auto& [folder, targets] : reaches) {
    if (targets.contains(folder)) complaints.push_back(folder + ": includes itself by way of other folders");
  }
  return complaints;
}

/// Complains of each line of code that `pattern` is found in, in the files that `applies` to.
template <typename Applies>
void find_in_code(const SourceTree& tree, const std::regex& pattern, const std::string& what, Applies applies,
                  Complaints& complaints) {
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || !applies(path)) continue;
    std::istringstream lines(code_of(text));
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      if (std::regex_search(line, pattern)) complaints.push_back(path + ":" + std::to_string(number) + ": " + what);
    }
  }
}

Complaints check_threads(const SourceTree& tree) {
  static const std::regex kThread(R"(\bstd\s*::\s*(j?thread|async)\b|\bpthread_create\b)");
  static const std::regex kMayStart(R"(^server/main\.cpp$|^(server/trainer|server/dds|clients/session)/.*)");
  Complaints complaints;
  find_in_code(
      tree, kThread, "starts a thread",
      [](const std::string& path) { return !is_under(path, "tests") && !std::regex_match(path, kMayStart); },
      complaints);
  return complaints;
}

Complaints check_sleeps(const SourceTree& tree) {
  static const std::regex kSleep(R"(\b(sleep_for|sleep_until)\b|\b(usleep|nanosleep|sleep)\s*\()");
  Complaints complaints;
  find_in_code(
      tree, kSleep, "sleeps instead of waiting for a state", [](const std::string&) { return true; }, complaints);
  return complaints;
}

Complaints check_mirror(const SourceTree& tree) {
  std::set<std::string> server, tests;
  for (const auto& [path, text] : tree) {
    const auto second = path.find('/', path.find('/') + 1);
    if (second == std::string::npos) continue;
    if (is_under(path, "server")) server.insert(path.substr(7, second - 7));
    if (is_under(path, "tests")) tests.insert(path.substr(6, second - 6));
  }
  Complaints complaints;
  for (const std::string& folder : tests) {
    if (server.contains(folder) || kTestFoldersWithoutMirror.contains(folder)) continue;
    complaints.push_back("tests/" + folder + ": there is no server/" + folder);
  }
  return complaints;
}

SourceTree read_source_tree() {
  SourceTree tree;
  const std::filesystem::path root = TRAMMEL_SOURCE_DIR;
  for (const char* folder : {"server", "clients", "idl", "tests"}) {
    if (!std::filesystem::exists(root / folder)) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      if (!entry.is_regular_file() || !is_source(entry.path().string())) continue;
      std::ifstream in(entry.path());
      std::ostringstream text;
      text << in.rdbuf();
      tree[std::filesystem::relative(entry.path(), root).generic_string()] = std::move(text).str();
    }
  }
  return tree;
}

std::string shown(const Complaints& complaints) {
  std::string text;
  for (const std::string& complaint : complaints) text += complaint + "\n";
  return text;
}

std::string include(const std::string& header) { return "#include \"" + header + "\"\n"; }

// The tree as it is.

TEST(Tidy, TheSourceTreeIsThere) {
  const SourceTree tree = read_source_tree();
  EXPECT_TRUE(tree.contains("server/base/result.h"));
  EXPECT_TRUE(tree.contains("tests/tidy_test.cpp"));
}

TEST(Tidy, FoldersIncludeLowerFloorsOnly) { EXPECT_EQ(shown(check_floors(read_source_tree())), ""); }

TEST(Tidy, LibrariesStayInTheFoldersThatOwnThem) { EXPECT_EQ(shown(check_reserved_libraries(read_source_tree())), ""); }

TEST(Tidy, NoFoldersIncludeEachOther) { EXPECT_EQ(shown(check_cycles(read_source_tree())), ""); }

TEST(Tidy, OnlyMainTrainerAndDdsStartThreads) { EXPECT_EQ(shown(check_threads(read_source_tree())), ""); }

TEST(Tidy, NobodySleeps) { EXPECT_EQ(shown(check_sleeps(read_source_tree())), ""); }

TEST(Tidy, TestFoldersMirrorTheServer) { EXPECT_EQ(shown(check_mirror(read_source_tree())), ""); }

// The checks themselves.

TEST(TidyChecks, AllowLowerFloorsAndTheOwnFolder) {
  EXPECT_EQ(
      shown(check_floors({{"server/calibrate/a.cpp",
                           include("server/calibrate/a.h") + include("server/measurement/m.h") + "#include <vector>\n"},
                          {"server/main.cpp", include("server/config/c.h")},
                          {"server/dds/d.cpp", include("idl/topics.h")}})),
      "");
}

TEST(TidyChecks, ComplainOfHigherFloorsAndSiblings) {
  EXPECT_EQ(
      shown(check_floors({{"server/robot/a.h", "\n" + include("server/calibrate/b.h")},
                          {"server/bias/b.cpp", include("server/calibrate/b.h")},
                          {"server/trainer/t.cpp", include("clients/session/session.h")},
                          {"server/store/s.cpp", include("idl/topics.h")}})),
      "server/bias/b.cpp:1: includes server/calibrate/b.h: server/calibrate is on floor 3, server/bias on floor 3\n"
      "server/robot/a.h:2: includes server/calibrate/b.h: server/calibrate is on floor 3, server/robot on floor 1\n"
      "server/store/s.cpp:1: includes idl/topics.h: idl is for server/dds\n"
      "server/trainer/t.cpp:1: includes clients/session/session.h: clients/session has no floor that the server "
      "knows\n");
}

TEST(TidyChecks, ComplainOfAFolderWithoutAFloor) {
  EXPECT_EQ(shown(check_floors({{"server/utils/a.h", ""}})), "server/utils/a.h: folder server/utils has no floor\n");
}

TEST(TidyChecks, LetClientsSeeTheirPartOnly) {
  EXPECT_EQ(
      shown(check_floors({{"clients/session/a.cpp", include("idl/topics.h") + include("server/base/result.h")},
                          {"clients/cam/a.cpp", include("clients/session/session.h")},
                          {"clients/cli/a.cpp", include("clients/cam/a.h") + include("server/trainer/train.h")}})),
      "");
  EXPECT_EQ(check_floors({{"clients/session/a.cpp", include("server/robot/chain.h")}}).size(), 1u);
  EXPECT_EQ(check_floors({{"clients/cam/a.cpp", include("server/robot/chain.h")}}).size(), 1u);
  EXPECT_EQ(check_floors({{"clients/session/a.cpp", include("clients/cli/a.h")}}).size(), 1u);
  EXPECT_EQ(check_floors({{"clients/cli/a.cpp", include("server/dds/codec.h")}}).size(), 1u);
  EXPECT_EQ(check_floors({{"clients/cli/a.cpp", include("idl/topics.h")}}).size(), 1u);
}

TEST(TidyChecks, LetConfigSeeOptionsOfAnyFloor) {
  EXPECT_EQ(
      check_floors({{"server/config/c.h", include("server/dds/dds_options.h") + include("server/dds/codec.h")}}).size(),
      0u);
  EXPECT_EQ(check_floors({{"server/registry/c.h", include("server/dds/dds_options.h")}}).size(), 1u);
}

TEST(TidyChecks, ComplainOfLibrariesOutsideTheirFolders) {
  const auto complaints = [](const std::string& path, const std::string& header) {
    return check_reserved_libraries({{path, "#include <" + header + ">\n"}}).size();
  };
  EXPECT_EQ(complaints("server/calibrate/solve.cpp", "ceres/ceres.h"), 0u);
  EXPECT_EQ(complaints("server/bias/solve.cpp", "ceres/ceres.h"), 1u);
  EXPECT_EQ(complaints("server/dds/a.cpp", "fastdds/dds/topic/Topic.hpp"), 0u);
  EXPECT_EQ(complaints("server/trainer/a.cpp", "fastdds/dds/topic/Topic.hpp"), 1u);
  EXPECT_EQ(complaints("clients/cli/a.cpp", "fastcdr/Cdr.h"), 1u);
  EXPECT_EQ(complaints("server/robot/cell_file.cpp", "yaml-cpp/yaml.h"), 0u);
  EXPECT_EQ(complaints("server/robot/cell.cpp", "yaml-cpp/yaml.h"), 1u);
  EXPECT_EQ(complaints("server/robot/cell.cpp", "server/base/yaml_file.h"), 1u);
  EXPECT_EQ(complaints("server/store/store.cpp", "SQLiteCpp/SQLiteCpp.h"), 0u);
  EXPECT_EQ(complaints("server/trainer/trainer.cpp", "sqlite3.h"), 1u);
}

TEST(TidyChecks, FindCyclesHoweverLong) {
  const SourceTree line = {{"server/a/a.h", include("server/b/b.h")},
                           {"server/b/b.h", include("server/c/c.h")},
                           {"server/c/c.h", include("server/c/d.h")},
                           {"server/c/d.h", ""}};
  EXPECT_EQ(shown(check_cycles(line)), "");
  SourceTree circle = line;
  circle["server/c/d.h"] = include("server/a/a.h");
  EXPECT_EQ(shown(check_cycles(circle)),
            "server/a: includes itself by way of other folders\nserver/b: includes itself by way of other folders\n"
            "server/c: includes itself by way of other folders\n");
}

TEST(TidyChecks, FindThreadsInCodeAndNotInComments) {
  EXPECT_EQ(shown(check_threads(
                {{"server/bias/a.cpp", "int a;\nstd::jthread worker;\n"},
                 {"server/bias/b.cpp", "// std::thread\nconst char* s = \"std::thread\"; /* std::\nthread */"},
                 {"server/bias/c.cpp", "std::this_thread::get_id();\n"},
                 {"server/trainer/trainer.h", "std::jthread worker_;\n"},
                 {"server/main.cpp", "std::jthread signals;\n"}})),
            "server/bias/a.cpp:2: starts a thread\n");
}

TEST(TidyChecks, TellCodeFromCommentsAndLiterals) {
  EXPECT_EQ(code_of("a // b\nc /* d\ne */ f"), "a \nc \n f");
  EXPECT_EQ(code_of("a(\"b \\\" // c\") + d"), "a() + d");
  EXPECT_EQ(code_of("R\"(a\n\"b\")\" + R\"x(c)\" d)x\" e"), "\n +  e");
  EXPECT_EQ(code_of("'\"' a '\\'' 1'000'000 b"), " a  1'000'000 b");
}

TEST(TidyChecks, FindSleepsEverywhere) {
  EXPECT_EQ(shown(check_sleeps({{"tests/bias/a_test.cpp", "/* one\ntwo */ std::this_thread::sleep_for(1s);\n"},
                                {"clients/cli/a.cpp", "usleep(10);\n"},
                                {"server/base/a.cpp", "const char* s = R\"(usleep(10))\"; // sleep(1)\n"}})),
            "clients/cli/a.cpp:1: sleeps instead of waiting for a state\n"
            "tests/bias/a_test.cpp:2: sleeps instead of waiting for a state\n");
}

TEST(TidyChecks, ComplainOfATestFolderWithoutItsServerFolder) {
  EXPECT_EQ(shown(check_mirror({{"server/bias/a.h", ""}, {"tests/bias/a_test.cpp", ""}, {"tests/fuzz/b.cpp", ""}})),
            "");
  EXPECT_EQ(shown(check_mirror({{"server/bias/a.h", ""}, {"tests/kernels/a_test.cpp", ""}})),
            "tests/kernels: there is no server/kernels\n");
}

}  // namespace
}  // namespace trammel
