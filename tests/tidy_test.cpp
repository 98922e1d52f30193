#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

// The rules of the house that a machine holds: who may include whom, who may start a thread, and
// that nobody sleeps. Rooms, floors and doors are those of the table in server/README.md. A source
// tree is a map from path to text, so that the checks themselves are tested on small made-up trees.

namespace trammel {
namespace {

using SourceTree = std::map<std::string, std::string>;
using Complaints = std::vector<std::string>;

/// The row of a room or of a room's subfolder in the table of server/README.md.
struct Room {
  std::optional<int> floor;  ///< a room's; a subfolder stands on its room's
  bool all_is_door = false;
  std::set<std::string> door;  ///< headers, relative to this folder
};
using Rooms = std::map<std::string, Room>;

constexpr int kFloorOfMain = 10;  // server/main.cpp

/// What the folders outside server/ see of our own tree, and the highest floor of server/ with it.
struct Outsider {
  std::set<std::string> folders;
  int highest_floor = 0;
};

const std::map<std::string, Outsider> kOutsiders = {
    {"clients/session",
     {{"idl", "idl/exchange", "idl/transport", "idl/repairs", "server/exchange"}, 0}},
    {"clients/cam", {{}, 2}},
    {"clients/programs", {{"clients/cam"}, 7}},
    {"clients/cli", {{"clients/session", "clients/cam", "clients/programs"}, 7}},
    {"clients/library", {{"clients/session", "clients/cam", "clients/programs"}, 7}},
    {"clients/python", {{}, -1}},
    {"clients", {{"clients/cli"}, -1}},
    {"idl", {{}, 0}},
    {"idl/exchange", {{"idl", "server/exchange"}, 0}},
    {"idl/repairs", {{"idl"}, 0}},
    {"idl/transport", {{"idl", "idl/repairs"}, 0}},
};

/// Headers of other people's libraries that only some may include.
struct Reserved {
  std::string name;
  std::regex header;
  std::regex may_include;  // paths
};
const std::vector<Reserved> kReserved = {
    {"Fast DDS", std::regex("^(fastdds|fastrtps|fastcdr)/.*"),
     std::regex("^(server/dds|clients/session|idl)/.*")},
    {"Ceres", std::regex("^ceres/.*"), std::regex("^server/(calibrate|diagnose)/.*")},
    {"yaml-cpp", std::regex("^yaml-cpp/.*"),
     std::regex("^server/config/.*|^(server|clients)/.*_file\\.(h|cpp)$")},
    {"the YAML reader", std::regex("^server/base/yaml_file\\.h$"),
     std::regex("^server/config/.*|^(server|clients)/.*_file\\.(h|cpp)$")},
    {"SQLite", std::regex("^(sqlite3\\.h|SQLiteCpp/.*)$"), std::regex("^server/store/.*")},
    {"libpq", std::regex("^postgresql/libpq-fe\\.h$"), std::regex("^server/store/database/.*")},
    {"the HTTP library", std::regex("^httplib\\.h$"), std::regex("^server/http/.*")},
    {"Prometheus", std::regex("^prometheus/.*"), std::regex("^server/http/.*")},
    {"spdlog and systemd", std::regex("^(spdlog|systemd)/.*"), std::regex("^server/host/.*")},
};

const std::set<std::string> kTestFoldersWithoutMirror = {"support", "end_to_end", "benchmarks",
                                                         "fuzz",    "package",    "clients"};

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
      code.append(static_cast<std::size_t>(std::count(text.begin() + at, text.begin() + end, '\n')),
                  '\n');
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

/// The cells of a line of a table in Markdown, without the spaces around them.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  std::string cell;
  std::getline(in, cell, '|');
  while (std::getline(in, cell, '|')) {
    const auto first = cell.find_first_not_of(' ');
    cells.push_back(first == std::string::npos
                        ? ""
                        : cell.substr(first, cell.find_last_not_of(' ') - first + 1));
  }
  return cells;
}

/// The words that stand between back quotes.
std::set<std::string> quoted(const std::string& cell) {
  static const std::regex kQuoted("`([^`]+)`");
  std::set<std::string> words;
  for (auto at = std::sregex_iterator(cell.begin(), cell.end(), kQuoted);
       at != std::sregex_iterator(); ++at)
    words.insert((*at)[1]);
  return words;
}

/// The rows `| floor | room | what is decided here | door |`; the floor of a subfolder is left
/// empty.
Rooms rooms_of(const std::string& readme) {
  Rooms rooms;
  std::istringstream lines(readme);
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string> cells = cells_of(line);
    if (cells.size() != 4 || !cells[1].starts_with("`")) continue;
    Room room{std::nullopt, cells[3] == "all", quoted(cells[3])};
    if (!cells[0].empty()) room.floor = std::stoi(cells[0]);
    rooms[*quoted(cells[1]).begin()] = room;
  }
  return rooms;
}

/// `server/bias` of `server/bias/kernels`; the folder itself where it is a room.
std::string room_of(const std::string& folder) {
  const auto slash = folder.find('/', folder.find('/') + 1);
  return slash == std::string::npos ? folder : folder.substr(0, slash);
}

/// The floor of a room of the server, its main program above them all.
std::optional<int> floor_of(const Rooms& rooms, const std::string& room) {
  if (room == "server") return kFloorOfMain;
  const auto found = rooms.find(room);
  return found == rooms.end() ? std::nullopt : found->second.floor;
}

/// Why a file in `folder` may not include `header`, a path of our own tree; nothing when it may. By
/// floors alone.
std::optional<std::string> why_not(const Rooms& rooms, const std::string& folder,
                                   const std::string& header) {
  const std::string target = room_of(folder_of(header)), room = room_of(folder);
  if (target == room) return std::nullopt;
  if (room == "server/config" && header.ends_with("_options.h")) return std::nullopt;
  // Whole programs are corrected there, too; both see lower floors alone.
  if (room == "server/gateway" && (target == "clients/cam" || target == "clients/programs"))
    return std::nullopt;
  const auto target_floor = floor_of(rooms, target);
  if (const auto outsider = kOutsiders.find(room); outsider != kOutsiders.end()) {
    if (outsider->second.folders.contains(target)) return std::nullopt;
    if (target_floor && *target_floor <= outsider->second.highest_floor) return std::nullopt;
    return target + " is not for " + room;
  }
  if (target == "idl" || target.starts_with("idl/")) {
    return room == "server/dds" ? std::nullopt
                                : std::optional<std::string>(target + " is for server/dds");
  }
  if (!target_floor) return target + " has no floor that the server knows";
  const int own = *floor_of(rooms, room);
  if (*target_floor < own) return std::nullopt;
  return target + " is on floor " + std::to_string(*target_floor) + ", " + room + " on floor " +
         std::to_string(own);
}

bool is_ours(const std::string& header) {
  return header.starts_with("server/") || header.starts_with("clients/") ||
         header.starts_with("idl/") || header.starts_with("tests/");
}

Complaints check_floors(const SourceTree& tree, const Rooms& rooms) {
  Complaints complaints;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    const std::string folder = folder_of(path), room = room_of(folder);
    const bool known = kOutsiders.contains(room) ||
                       (floor_of(rooms, room) && (room == folder || rooms.contains(folder)));
    if (!known) {
      complaints.push_back(path + ": folder " + folder + " has no floor");
      continue;
    }
    for (const auto& [line, header] : includes_of(text)) {
      if (!is_ours(header)) continue;
      if (const auto reason = why_not(rooms, folder, header))
        complaints.push_back(path + ":" + std::to_string(line) + ": includes " + header + ": " +
                             *reason);
    }
  }
  return complaints;
}

/// True if the door of `folder` lets this header out.
bool is_door(const Rooms& rooms, const std::string& folder, const std::string& header) {
  const auto room = rooms.find(folder);
  return room == rooms.end() || room->second.all_is_door ||
         room->second.door.contains(header.substr(folder.size() + 1));
}

/// The folder whose inside a file may see: its own; for a test, the room that it mirrors.
std::string inside_of(const std::string& path) {
  const std::string folder = folder_of(path);
  if (!is_under(path, "tests")) return folder;
  return folder == "tests/clients" ? "clients/cli"
                                   : "server" + room_of(folder).substr(std::string("tests").size());
}

/// The folder whose door keeps `header` from the file at `path`; nothing where the file may see it.
std::optional<std::string> shut_by(const Rooms& rooms, const std::string& path,
                                   const std::string& header) {
  const std::string inside = inside_of(path), target = folder_of(header), room = room_of(target);
  const bool same_room = room_of(inside) == room;
  if (same_room && (is_under(path, "tests") || target == inside)) return std::nullopt;
  const std::string& shut = same_room ? target : room;
  if ((same_room && target == room) || is_door(rooms, shut, header)) return std::nullopt;
  return shut;
}

/// Complains of headers that are inside another room, or inside another subfolder of the same room.
/// Benchmarks may measure anything, and any reader may be fuzzed.
Complaints check_doors(const SourceTree& tree, const Rooms& rooms) {
  Complaints complaints;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests/benchmarks") || is_under(path, "tests/fuzz"))
      continue;
    for (const auto& [line, header] : includes_of(text)) {
      if (!is_ours(header) || is_under(header, "tests")) continue;
      if (const auto shut = shut_by(rooms, path, header))
        complaints.push_back(path + ":" + std::to_string(line) + ": includes " + header +
                             ", which is inside " + *shut);
    }
  }
  return complaints;
}

/// Complains of doors that name a header which is not there.
Complaints check_doors_lead_somewhere(const SourceTree& tree, const Rooms& rooms) {
  Complaints complaints;
  for (const auto& [folder, room] : rooms) {
    for (const std::string& header : room.door) {
      if (!tree.contains(folder + "/" + header))
        complaints.push_back(folder + ": there is no " + header);
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
        if (!std::regex_match(header, reserved.header) ||
            std::regex_match(path, reserved.may_include))
          continue;
        complaints.push_back(path + ":" + std::to_string(line) + ": " + reserved.name +
                             " is not for this file");
      }
    }
  }
  return complaints;
}

using Graph = std::map<std::string, std::set<std::string>>;

/// The nodes that lead to themselves, however long the way round.
std::set<std::string> in_circles(Graph reaches) {
  for (bool grew = true; grew;) {
    grew = false;
    for (auto& [node, targets] : reaches) {
      const std::set<std::string> known = targets;
      for (const std::string& target : known) {
        if (const auto further = reaches.find(target); further != reaches.end())
          targets.insert(further->second.begin(), further->second.end());
      }
      grew = grew || targets.size() != known.size();
    }
  }
  std::set<std::string> nodes;
  for (const auto& [node, targets] : reaches) {
    if (targets.contains(node)) nodes.insert(node);
  }
  return nodes;
}

/// Who includes whom among the nodes that `node_of` makes of paths. A room's own files may use its
/// subfolders and be used by them.
template <typename NodeOf>
Graph graph_of(const SourceTree& tree, NodeOf node_of) {
  Graph graph;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    for (const auto& include : includes_of(text)) {
      if (!tree.contains(include.header) || node_of(include.header) == node_of(path)) continue;
      graph[node_of(path)].insert(node_of(include.header));
    }
  }
  return graph;
}

/// Files that include each other, a header and its source taken as one; rooms; and the subfolders
/// of a room.
Complaints check_circles(const SourceTree& tree) {
  const auto without_ending = [](const std::string& path) {
    return path.substr(0, path.rfind('.'));
  };
  const auto room = [](const std::string& path) { return room_of(folder_of(path)); };
  Graph folders = graph_of(tree, folder_of);
  std::erase_if(folders, [](const auto& node) { return node.first == room_of(node.first); });
  Complaints complaints;
  for (const Graph& graph : {graph_of(tree, without_ending), graph_of(tree, room), folders}) {
    for (const std::string& node : in_circles(graph))
      complaints.push_back(node + ": includes itself by way of others");
  }
  return complaints;
}

/// Complains of each line of code that `pattern` is found in, in the files that `applies` to.
template <typename Applies>
void find_in_code(const SourceTree& tree, const std::regex& pattern, const std::string& what,
                  Applies applies, Complaints& complaints) {
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || !applies(path)) continue;
    std::istringstream lines(code_of(text));
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      if (std::regex_search(line, pattern))
        complaints.push_back(path + ":" + std::to_string(number) + ": " + what);
    }
  }
}

/// The spellings of the causes that ship, as their list has them.
std::vector<std::string> shipped_causes(const SourceTree& tree) {
  static const std::regex kLine(R"(\bCAUSE\((\w+)\))");
  std::vector<std::string> causes;
  const auto list = tree.find("server/error_sources/shipped_causes.h");
  if (list == tree.end()) return causes;
  for (std::sregex_iterator one(list->second.begin(), list->second.end(), kLine), end; one != end;
       ++one)
    if ((*one)[1] != "CAUSE") causes.push_back((*one)[1]);
  return causes;
}

/// Complains of whoever asks for a cause by its spelling instead of asking its record: by a
/// comparison, by the beginning or end of a text, by looking its record up, by adding it to a list,
/// or by a table with a spelling for a key.
Complaints check_causes(const SourceTree& tree) {
  std::string any;
  for (const std::string& cause : shipped_causes(tree)) any += (any.empty() ? "" : "|") + cause;
  Complaints complaints;
  if (any.empty()) return complaints;
  const std::string spelling = "\"(" + any + ")[:@_]?\"";
  const std::regex asks("[=!]= *" + spelling + "|" + spelling +
                        " *[=!]=|(starts_with|ends_with|contains|find|count|compare|cause_spelled|"
                        "find_cause|emplace_back|push_back)\\(" +
                        spelling + "|(^|[{,]) *\\{" + spelling + ", \"");
  for (const auto& [path, text] : tree) {
    const bool is_of_server = is_under(path, "server") && !is_under(path, "server/error_sources");
    if (!is_source(path) || !(is_of_server || is_under(path, "clients"))) continue;
    std::istringstream lines(text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      if (std::regex_search(line, asks))
        complaints.push_back(path + ":" + std::to_string(number) +
                             ": asks for a cause by its spelling");
    }
  }
  return complaints;
}

/// Complains of whoever decides by the words of a message: by what an error's sentence holds, or by
/// a text of several words anywhere. Readers of files of other programs may: what they read has no
/// other form.
Complaints check_words(const SourceTree& tree) {
  const std::string asks = R"(\.(find|rfind|starts_with|ends_with|contains|compare)\()";
  static const std::regex kOfAMessage(
      R"((\bmessage|\bsentence(\([^()]*\))?|\bwhat\(\)\)*|\bwhy|\bverdict|\bnext))" + asks +
      R"(|(\.message|\bsentence(\([^()]*\))?) *[=!]= *")");
  static const std::regex kOfWords(asks + R"re("[^"]*[A-Za-z'] [A-Za-z][^"]*")re");
  static const std::regex kReaders(
      R"(^(server/measurement/files|clients/cam/\w+)/.*|^server/robot/branch_hint\.cpp$)");
  Complaints complaints;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || !(is_under(path, "server") || is_under(path, "clients"))) continue;
    if (std::regex_match(path, kReaders)) continue;
    std::istringstream lines(text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      if (std::regex_search(line, kOfAMessage) || std::regex_search(line, kOfWords))
        complaints.push_back(path + ":" + std::to_string(number) +
                             ": decides by the words of a message");
    }
  }
  return complaints;
}

Complaints check_threads(const SourceTree& tree) {
  static const std::regex kThread(R"(\bstd\s*::\s*(j?thread|async)\b|\bpthread_create\b)");
  static const std::regex kMayStart(
      R"(^server/(main\.cpp|host/caught_signals\.(h|cpp))$|)"
      R"(^(server/trainer|server/dds|server/http|clients/session|clients/cli/work)/.*)");
  Complaints complaints;
  find_in_code(
      tree, kThread, "starts a thread",
      [](const std::string& path) {
        return !is_under(path, "tests") && !std::regex_match(path, kMayStart);
      },
      complaints);
  return complaints;
}

Complaints check_sleeps(const SourceTree& tree) {
  static const std::regex kSleep(R"(\b(sleep_for|sleep_until)\b|\b(usleep|nanosleep|sleep)\s*\()");
  Complaints complaints;
  find_in_code(
      tree, kSleep, "sleeps instead of waiting for a state",
      [](const std::string&) { return true; }, complaints);
  return complaints;
}

/// Complains of locks that clang does not see, and of mutexes that say neither by an annotation nor
/// by a comment on their line what they guard.
Complaints check_locks(const SourceTree& tree) {
  static const std::regex kUnseen(
      R"(\bstd\s*::\s*((recursive_|shared_|timed_)*mutex|(lock|scoped|unique|shared)_(guard|lock)|condition_variable(_any)?)\b)");
  static const std::regex kMutex(R"(^ +(mutable )?Mutex (\w+_?);( *//.*)?$)");
  Complaints complaints;
  find_in_code(
      tree, kUnseen, "a lock that is not of server/base/mutex.h",
      [](const std::string& path) {
        return !is_under(path, "tests") && path != "server/base/mutex.h";
      },
      complaints);
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || is_under(path, "tests")) continue;
    std::istringstream lines(text);
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      std::smatch mutex;
      if (!std::regex_match(line, mutex, kMutex) || mutex[3].matched) continue;
      if (text.find("TRAMMEL_GUARDED_BY(" + mutex.str(2) + ")") == std::string::npos)
        complaints.push_back(path + ":" + std::to_string(number) + ": " + mutex.str(2) +
                             " guards nothing");
    }
  }
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

// The length of functions.

/// The most lines of a function, from the first of its declaration to its closing brace.
constexpr int kMostLines = 60;

struct Function {
  std::string name;
  int line = 0;   ///< its first
  int lines = 0;  ///< with the closing brace
};

/// Code without preprocessor lines; lines stay where they are.
std::string without_directives(const std::string& code) {
  std::istringstream lines(code);
  std::string kept;
  bool continued = false;
  for (std::string line; std::getline(lines, line);) {
    const auto first = line.find_first_not_of(" \t");
    const bool directive = continued || (first != std::string::npos && line[first] == '#');
    continued = directive && line.ends_with('\\');
    kept += (directive ? "" : line) + "\n";
  }
  return kept;
}

/// `text` with what stands in round or square brackets left out, the brackets kept.
std::string outside_brackets(const std::string& text) {
  std::string outside;
  int depth = 0;
  for (const char c : text) {
    if (c == ')' || c == ']') --depth;
    if (depth <= 0) outside += c;
    if (c == '(' || c == '[') ++depth;
  }
  return outside;
}

/// The kind of scope that a brace opens, by the text between it and the statement before.
enum class Opens { kScope, kFunction, kMember, kOther };
Opens opened_by(const std::string& header) {
  static const std::regex kType(
      R"(^(template\s*<.*>)?\s*(inline\s+)?((namespace|class|struct|union|enum)\b|extern\s*$))");
  static const std::regex kOperator(R"(\boperator\s*(\(\)|\[\]|[^\s\w(]+))"),
      kTemplate(R"(^\s*template\s*<[^()]*?>\s)");
  static const std::regex kMember(R"(\(\)[^:]*:[^:].*[\w>]\s*$)");
  const std::string plain =
      std::regex_replace(std::regex_replace(header, kOperator, "called"), kTemplate, "");
  const std::string outside = outside_brackets(plain);
  if (outside.find('=') != std::string::npos) return Opens::kOther;
  if (std::regex_search(plain, kType)) return Opens::kScope;
  if (std::regex_search(outside, kMember)) return Opens::kMember;
  return outside.find("()") != std::string::npos ? Opens::kFunction : Opens::kOther;
}

std::string name_in(const std::string& header) {
  static const std::regex kName(R"(([\w~]+|operator\s*[^\s\w(]+|operator\s*\(\))\s*\()");
  std::smatch found;
  return std::regex_search(header, found, kName) ? std::string(found[1]) : header;
}

/// The functions of a file; what stands inside a function, lambdas and local types, is part of it.
std::vector<Function> functions_of(std::string_view text) {
  const std::string code = without_directives(code_of(text));
  std::vector<Function> functions;
  std::string header;  // since the last statement or brace of a scope
  int line = 1, first = 1, inside = 0;
  bool is_function = false;
  for (const char c : code) {
    if (c == '\n') ++line;
    if (inside > 0) {
      inside += c == '{' ? 1 : c == '}' ? -1 : 0;
      if (inside > 0) continue;
      if (is_function) functions.push_back({name_in(header), first, line - first + 1});
      if (is_function) header.clear();
      continue;
    }
    const Opens opens = c == '{' ? opened_by(header) : Opens::kScope;
    if (c == '{' && opens != Opens::kScope) {
      inside = 1;
      is_function = opens == Opens::kFunction;
    } else if (c == '{' || c == '}' ||
               (c == ';' && outside_brackets(header + ";").ends_with(';'))) {
      header.clear();
    } else if (!header.empty() || !std::isspace(static_cast<unsigned char>(c))) {
      if (header.empty()) first = line;
      header += c;
      if (header == "public:" || header == "private:" || header == "protected:") header.clear();
    }
  }
  return functions;
}

/// The functions of server/ and clients/ of three lines and more: shorter ones are names for an
/// expression.
std::vector<Function> functions_of(const SourceTree& tree) {
  std::vector<Function> all;
  for (const auto& [path, text] : tree) {
    if (!is_source(path) || !(is_under(path, "server") || is_under(path, "clients"))) continue;
    for (Function& function : functions_of(text)) {
      function.name = path + ":" + std::to_string(function.line) + ": " + function.name;
      if (function.lines >= 3) all.push_back(std::move(function));
    }
  }
  return all;
}

Complaints check_lengths(const std::vector<Function>& functions) {
  Complaints complaints;
  for (const Function& function : functions) {
    if (function.lines <= kMostLines) continue;
    complaints.push_back(function.name + ": " + std::to_string(function.lines) + " lines, limit " +
                         std::to_string(kMostLines));
  }
  return complaints;
}

/// `1234 functions, median 8 lines, 90 % at most 23, longest 60`; of one room where `folder` says
/// it.
std::string lengths_in(const std::vector<Function>& functions, const std::string& folder) {
  std::vector<int> lines;
  for (const Function& function : functions) {
    if (function.name.starts_with(folder + "/")) lines.push_back(function.lines);
  }
  std::sort(lines.begin(), lines.end());
  if (lines.empty()) return "no functions";
  const auto at = [&](double share) {
    return std::to_string(
        lines[static_cast<std::size_t>(share * static_cast<double>(lines.size() - 1))]);
  };
  return std::to_string(lines.size()) + " functions, median " + at(0.5) + " lines, 90 % at most " +
         at(0.9) + ", longest " + at(1);
}

Rooms read_rooms() {
  std::ifstream in(std::filesystem::path(TRAMMEL_SOURCE_DIR) / "server/README.md");
  std::ostringstream text;
  text << in.rdbuf();
  return rooms_of(std::move(text).str());
}

SourceTree read_source_tree(const std::function<bool(std::string_view)>& is_read = is_source) {
  SourceTree tree;
  const std::filesystem::path root = TRAMMEL_SOURCE_DIR;
  for (const char* folder : {"server", "clients", "idl", "tests"}) {
    if (!std::filesystem::exists(root / folder)) continue;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      if (!entry.is_regular_file() || !is_read(entry.path().string())) continue;
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

TEST(Tidy, RoomsIncludeLowerFloorsOnly) {
  EXPECT_EQ(shown(check_floors(read_source_tree(), read_rooms())), "");
}

TEST(Tidy, NobodyLooksBehindADoor) {
  EXPECT_EQ(shown(check_doors(read_source_tree(), read_rooms())), "");
  EXPECT_EQ(shown(check_doors_lead_somewhere(read_source_tree(), read_rooms())), "");
}

TEST(Tidy, LibrariesStayInTheFoldersThatOwnThem) {
  EXPECT_EQ(shown(check_reserved_libraries(read_source_tree())), "");
}

TEST(Tidy, NothingIncludesItselfByWayOfOthers) {
  EXPECT_EQ(shown(check_circles(read_source_tree())), "");
}

TEST(Tidy, NobodyAsksForACauseByItsSpelling) {
  const SourceTree tree = read_source_tree();
  EXPECT_GT(shipped_causes(tree).size(), 15u);
  EXPECT_EQ(shown(check_causes(tree)), "");
}

TEST(Tidy, NobodyDecidesByTheWordsOfAMessage) {
  EXPECT_EQ(shown(check_words(read_source_tree())), "");
}

TEST(Tidy, OnlyMainTrainerAndDdsStartThreads) {
  EXPECT_EQ(shown(check_threads(read_source_tree())), "");
}

TEST(Tidy, NobodySleeps) { EXPECT_EQ(shown(check_sleeps(read_source_tree())), ""); }

TEST(Tidy, NoFunctionIsLongerThanAScreen) {
  const SourceTree tree = read_source_tree();
  const std::vector<Function> all = functions_of(tree);
  EXPECT_EQ(shown(check_lengths(all)), "");
  std::set<std::string> rooms;
  for (const auto& [path, text] : tree) rooms.insert(room_of(folder_of(path)));
  for (const std::string& room : rooms) {
    if (is_under(room, "server") || is_under(room, "clients"))
      std::cout << room << ": " << lengths_in(all, room) << "\n";
  }
  std::cout << "server: " << lengths_in(all, "server")
            << "\nclients: " << lengths_in(all, "clients") << "\n";
}

TEST(Tidy, AFigureOfAPredictionIsSpelledInEightFilesAtMost) {
  const auto is_product = [](std::string_view path) {
    return is_source(path) || path.ends_with(".idl") || path.ends_with(".py");
  };
  // Two more files compute a figure: compensated_model.h and predict.cpp, in the model's own words.
  constexpr int kMost = 6;
  for (const char* names : {R"(\bbias_share\b)", R"(\brotation_stddev_deg\b|\bsr[xyz]_rad\b)"}) {
    std::string spelled_in;
    int files = 0;
    for (const auto& [path, text] : read_source_tree(is_product)) {
      if (is_under(path, "tests") || !std::regex_search(text, std::regex(names))) continue;
      ++files;
      spelled_in += path + "\n";
    }
    EXPECT_GE(files, 4) << names << " is another name now:\n" << spelled_in;
    EXPECT_LE(files, kMost) << names << ":\n" << spelled_in;
  }
}

TEST(Tidy, EveryLockIsOneThatTheCompilerChecks) {
  EXPECT_EQ(shown(check_locks(read_source_tree())), "");
}

TEST(Tidy, TestFoldersMirrorTheServer) { EXPECT_EQ(shown(check_mirror(read_source_tree())), ""); }

// The checks themselves.

/// A small house: four rooms, one with two subfolders.
const Rooms& small_house() {
  static const Rooms kRooms = rooms_of(
      "| floor | room | what is decided here | door |\n|---|---|---|---|\n"
      "| 0 | `server/base` | results | all |\n"
      "| 3 | `server/bias` | the rest | `model.h` `kernels/spelling.h` |\n"
      "| | `server/bias/kernels` | kernels | `kernel.h` `spelling.h` |\n"
      "| | `server/bias/search` | starts | none |\n"
      "| 3 | `server/calibrate` | parameters | `c.h` |\n"
      "| 7 | `server/trainer` | jobs | `trainer.h` |\n"
      "| 8 | `server/dds` | requests | all |\n"
      "| 9 | `server/config` | files | all |\n");
  return kRooms;
}

std::string floors(const SourceTree& tree) { return shown(check_floors(tree, small_house())); }
std::string doors(const SourceTree& tree) { return shown(check_doors(tree, small_house())); }

TEST(TidyChecks, ReadRoomsFloorsAndDoorsFromATable) {
  EXPECT_EQ(small_house().size(), 8u);
  EXPECT_EQ(small_house().at("server/dds").floor, 8);
  EXPECT_TRUE(small_house().at("server/base").all_is_door);
  EXPECT_EQ(small_house().at("server/bias/kernels").floor, std::nullopt);
  EXPECT_TRUE(small_house().at("server/bias/search").door.empty());
}

TEST(TidyChecks, AllowLowerFloorsAndTheOwnRoom) {
  EXPECT_EQ(
      floors({{"server/calibrate/a.cpp", include("server/calibrate/a.h") +
                                             include("server/base/m.h") + "#include <vector>\n"},
              {"server/main.cpp", include("server/config/c.h")},
              {"server/bias/kernels/k.cpp", include("server/bias/model.h")},
              {"server/dds/d.cpp", include("idl/topics.h")}}),
      "");
}

TEST(TidyChecks, ComplainOfHigherFloorsAndSiblings) {
  EXPECT_EQ(floors({{"server/base/a.h", "\n" + include("server/calibrate/b.h")},
                    {"server/bias/kernels/b.cpp", include("server/calibrate/b.h")},
                    {"server/trainer/t.cpp",
                     include("clients/session/session.h") + include("idl/topics.h")}}),
            "server/base/a.h:2: includes server/calibrate/b.h: server/calibrate is on floor 3, "
            "server/base on floor 0\n"
            "server/bias/kernels/b.cpp:1: includes server/calibrate/b.h: server/calibrate is on "
            "floor 3, server/bias on floor 3\n"
            "server/trainer/t.cpp:1: includes clients/session/session.h: clients/session has no "
            "floor that the server knows\n"
            "server/trainer/t.cpp:2: includes idl/topics.h: idl is for server/dds\n");
}

TEST(TidyChecks, ComplainOfAFolderThatIsNotInTheTable) {
  EXPECT_EQ(floors({{"server/utils/a.h", ""}, {"server/bias/more/a.h", ""}}),
            "server/bias/more/a.h: folder server/bias/more has no floor\n"
            "server/utils/a.h: folder server/utils has no floor\n");
}

TEST(TidyChecks, LetClientsSeeTheirPartOnly) {
  EXPECT_EQ(
      floors(
          {{"clients/session/a.cpp", include("idl/topics.h") + include("server/base/result.h")},
           {"clients/cam/a.cpp", include("server/base/result.h")},
           {"clients/cli/a.cpp", include("clients/cam/a.h") + include("server/trainer/train.h")}}),
      "");
  EXPECT_NE(floors({{"clients/session/a.cpp", include("server/bias/model.h")}}), "");
  EXPECT_NE(floors({{"clients/cam/a.cpp", include("server/bias/model.h")}}), "");
  EXPECT_NE(floors({{"clients/cam/a.cpp", include("clients/session/session.h")}}), "");
  EXPECT_NE(floors({{"clients/session/a.cpp", include("clients/cli/a.h")}}), "");
  EXPECT_NE(floors({{"clients/cli/a.cpp", include("server/dds/codec.h")}}), "");
  EXPECT_NE(floors({{"clients/cli/a.cpp", include("idl/topics.h")}}), "");
}

TEST(TidyChecks, LetConfigSeeOptionsOfAnyFloor) {
  EXPECT_EQ(floors({{"server/config/c.h",
                     include("server/dds/dds_options.h") + include("server/dds/codec.h")}}),
            "");
  EXPECT_NE(floors({{"server/trainer/c.h", include("server/dds/dds_options.h")}}), "");
}

TEST(TidyChecks, LetTheRoomItsTestsAndItsDoorSeeWhatIsInside) {
  EXPECT_EQ(doors({{"server/bias/model.cpp",
                    include("server/bias/inner.h") + include("server/bias/kernels/kernel.h")},
                   {"server/bias/kernels/tiles.cpp",
                    include("server/bias/kernels/tiles.h") + include("server/bias/inner.h")},
                   {"server/trainer/t.cpp",
                    include("server/bias/model.h") + include("server/bias/kernels/spelling.h")},
                   {"tests/bias/a_test.cpp",
                    include("server/bias/kernels/tiles.h") + include("server/bias/inner.h")},
                   {"tests/benchmarks/a.cpp", include("server/bias/inner.h")}}),
            "");
}

TEST(TidyChecks, ComplainOfWhoeverLooksBehindADoor) {
  EXPECT_EQ(
      doors({{"server/bias/search/starts.cpp", include("server/bias/kernels/tiles.h")},
             {"server/trainer/t.cpp",
              include("server/bias/inner.h") + include("server/bias/kernels/kernel.h")},
             {"tests/trainer/t_test.cpp", include("server/bias/inner.h")}}),
      "server/bias/search/starts.cpp:1: includes server/bias/kernels/tiles.h, which is inside "
      "server/bias/kernels\n"
      "server/trainer/t.cpp:1: includes server/bias/inner.h, which is inside server/bias\n"
      "server/trainer/t.cpp:2: includes server/bias/kernels/kernel.h, which is inside server/bias\n"
      "tests/trainer/t_test.cpp:1: includes server/bias/inner.h, which is inside server/bias\n");
}

TEST(TidyChecks, ComplainOfADoorThatLeadsNowhere) {
  EXPECT_EQ(
      shown(check_doors_lead_somewhere(
          {{"server/bias/a.h", ""}}, rooms_of("| 3 | `server/bias` | the rest | `a.h` `b.h` |\n"))),
      "server/bias: there is no b.h\n");
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

TEST(TidyChecks, FindCirclesOfRoomsHoweverLong) {
  const SourceTree line = {{"server/a/a.h", include("server/b/b.h")},
                           {"server/b/b.h", include("server/c/c.h")},
                           {"server/c/c.h", include("server/c/d.h")},
                           {"server/c/d.h", ""}};
  EXPECT_EQ(shown(check_circles(line)), "");
  SourceTree circle = line;
  circle["server/c/d.h"] = include("server/a/e.h");
  circle["server/a/e.h"] = "";
  EXPECT_EQ(
      shown(check_circles(circle)),
      "server/a: includes itself by way of others\nserver/b: includes itself by way of others\n"
      "server/c: includes itself by way of others\n");
}

TEST(TidyChecks, FindCirclesOfFilesAHeaderAndItsSourceTakenAsOne) {
  EXPECT_EQ(
      shown(check_circles({{"server/a/a.h", ""},
                           {"server/a/a.cpp", include("server/a/a.h") + include("server/a/b.h")},
                           {"server/a/b.h", include("server/a/a.h")}})),
      "server/a/a: includes itself by way of others\nserver/a/b: includes itself by way of "
      "others\n");
}

TEST(TidyChecks, FindCirclesOfSubfoldersButLetARoomAndItsSubfoldersMeet) {
  EXPECT_EQ(shown(check_circles({{"server/a/a.h", ""},
                                 {"server/a/b.cpp", include("server/a/x/c.h")},
                                 {"server/a/x/c.h", include("server/a/a.h")}})),
            "");
  EXPECT_EQ(shown(check_circles({{"server/a/x/a.h", include("server/a/y/b.h")},
                                 {"server/a/y/b.h", ""},
                                 {"server/a/y/c.h", include("server/a/x/d.h")},
                                 {"server/a/x/d.h", ""}})),
            "server/a/x: includes itself by way of others\nserver/a/y: includes itself by way of "
            "others\n");
}

TEST(TidyChecks, FindWhoeverAsksForACauseByItsSpelling) {
  const std::string list = "#define CAUSES(CAUSE) \\\n  CAUSE(tool) \\\n  CAUSE(joint_map)\n";
  const auto complaints = [&](const std::string& path, const std::string& line) {
    return check_causes({{"server/error_sources/shipped_causes.h", list}, {path, line}}).size();
  };
  EXPECT_EQ(complaints("server/plan/a.cpp", "if (cause == \"tool\") return;"), 1u);
  EXPECT_EQ(complaints("clients/cli/a.cpp", "if (\"joint_map\" != cause) return;"), 1u);
  EXPECT_EQ(complaints("server/plan/a.cpp", "name.starts_with(\"joint_map:\")"), 1u);
  EXPECT_EQ(complaints("server/plan/a.cpp", "contains(\"tool\")"), 1u);
  EXPECT_EQ(complaints("server/plan/a.cpp", "{\"joint_map\", \"a map of a joint\"},"), 1u);
  EXPECT_EQ(complaints("server/plan/a.cpp", "sources.emplace_back(\"tool\");"), 1u);
  EXPECT_EQ(complaints("server/plan/a.cpp",
                       "if (&source.cause() == &cause_spelled(\"joint_map\")) return;"),
            1u);
  EXPECT_EQ(complaints("server/plan/a.cpp", "sources.emplace_back(record.spelling);"), 0u);
  EXPECT_EQ(complaints("server/error_sources/tool.cpp", "if (cause == \"tool\") return;"), 0u);
}

TEST(TidyChecks, FindWhoeverDecidesByTheWordsOfAMessage) {
  const auto complaints = [](const std::string& path, const std::string& line) {
    return check_words({{path, line}}).size();
  };
  EXPECT_EQ(complaints("clients/cli/a.cpp", "if (error.message.find(\"written\") != npos) return;"),
            1u);
  EXPECT_EQ(complaints("server/dds/a.cpp", "if (sentence(error).starts_with(kBusy)) return;"), 1u);
  EXPECT_EQ(
      complaints("server/store/a.cpp", "if (std::string(error.what()).find(kFull) == 0) return;"),
      1u);
  EXPECT_EQ(complaints("server/store/a.cpp",
                       "if (std::string_view(e.what()).find(\"disk is full\")) return;"),
            1u);
  EXPECT_EQ(complaints("server/bias/a.cpp", "other.verdict.starts_with(\"not\")"), 1u);
  EXPECT_EQ(complaints("server/bias/a.cpp", "text.contains(\"not clearly\")"), 1u);
  EXPECT_EQ(complaints("clients/cli/a.cpp", "if (answer.message == \"no model\") return;"), 1u);
  EXPECT_EQ(complaints("clients/cli/a.cpp",
                       "if (row.status == \"out_of_domain\" || text.find(\": \") > 0) return;"),
            0u);
  EXPECT_EQ(complaints("server/measurement/files/a.cpp", "line.starts_with(\"Point Name\")"), 0u);
}

TEST(TidyChecks, FindThreadsInCodeAndNotInComments) {
  EXPECT_EQ(
      shown(check_threads({{"server/bias/a.cpp", "int a;\nstd::jthread worker;\n"},
                           {"server/bias/b.cpp",
                            "// std::thread\nconst char* s = \"std::thread\"; /* std::\nthread */"},
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

std::string functions(std::string_view text) {
  std::string all;
  for (const Function& function : functions_of(text))
    all += function.name + " " + std::to_string(function.line) + " " +
           std::to_string(function.lines) + "\n";
  return all;
}

TEST(TidyChecks, CountTheLinesOfFunctionsFromTheirFirstToTheirBrace) {
  EXPECT_EQ(
      functions("#include <a>\nnamespace a {\n\nint one() { return 1; }\n\n"
                "// { not code\ntemplate <int N = 3>\nint\ntwo(int a = 3) {\n  return a;\n}\n}\n"),
      "one 4 1\ntwo 7 5\n");
  EXPECT_EQ(
      functions(
          "class CAPABILITY(1) A final : public B {\n  A() : a_{1}, b_(2) {\n    a_ = b_;\n  }\n  "
          "bool operator==(A b) const {\n"
          "    return true;\n  }\n private:\n  int f() const override {\n    return 3;\n  }\n};\n"),
      "A 2 3\noperator== 5 3\nf 9 3\n");
}

TEST(TidyChecks, TakeWhatStandsInAFunctionForAPartOfIt) {
  EXPECT_EQ(
      functions("void f() {\n  const auto g = [](int a) {\n    return a;\n  };\n  struct B {\n    "
                "int h() {\n"
                "      return 1;\n    }\n  };\n  if (g(1)) {\n    for (;;) {\n    }\n  }\n}\n"),
      "f 1 14\n");
}

TEST(TidyChecks, TakeTablesAndTypesForNoFunctions) {
  EXPECT_EQ(
      functions("const A kTable[] = {\n  {f(1), {2}},\n  {g()}};\nenum class E {\n  kA,\n  kB };\n"
                "int x{3};\nstd::array<int, 2> y() {\n  return {1, 2};\n}\n"),
      "y 8 3\n");
}

TEST(TidyChecks, ComplainOfFunctionsThatAreTooLong) {
  const auto lines = [](int count) {
    std::string text = "void f() {\n";
    for (int i = 2; i < count; ++i) text += "  g();\n";
    return text + "}\n";
  };
  EXPECT_EQ(shown(check_lengths(functions_of(
                SourceTree{{"server/a/a.cpp", lines(60)}, {"tests/a/a.cpp", lines(100)}}))),
            "");
  EXPECT_EQ(shown(check_lengths(functions_of(SourceTree{{"server/a/a.cpp", "\n" + lines(61)},
                                                        {"clients/b/b.h", lines(3) + lines(70)}}))),
            "clients/b/b.h:4: f: 70 lines, limit 60\nserver/a/a.cpp:2: f: 61 lines, limit 60\n");
}

TEST(TidyChecks, TellMedianAndLongestOfARoom) {
  EXPECT_EQ(
      lengths_in(functions_of(SourceTree{
                     {"server/a/a.cpp",
                      "void f() {\n  g();\n}\nvoid h() {\n  g();\n\n}\nint i() { return 1; }\n"}}),
                 "server/a"),
      "2 functions, median 3 lines, 90 % at most 3, longest 4");
}

TEST(TidyChecks, FindSleepsEverywhere) {
  EXPECT_EQ(shown(check_sleeps(
                {{"tests/bias/a_test.cpp", "/* one\ntwo */ std::this_thread::sleep_for(1s);\n"},
                 {"clients/cli/a.cpp", "usleep(10);\n"},
                 {"server/base/a.cpp", "const char* s = R\"(usleep(10))\"; // sleep(1)\n"}})),
            "clients/cli/a.cpp:1: sleeps instead of waiting for a state\n"
            "tests/bias/a_test.cpp:2: sleeps instead of waiting for a state\n");
}

TEST(TidyChecks, FindLocksThatTheCompilerDoesNotCheck) {
  EXPECT_EQ(shown(check_locks(
                {{"server/base/mutex.h", "std::mutex mutex_;\n"},
                 {"server/a/a.h", "  std::mutex mutex_;\n  std::condition_variable_any c_;\n"},
                 {"server/b/b.cpp", "const std::lock_guard lock(mutex_);\nstd::once_flag once;\n"},
                 {"tests/b/b_test.cpp", "std::mutex mutex_;\n"}})),
            "server/a/a.h:1: a lock that is not of server/base/mutex.h\n"
            "server/a/a.h:2: a lock that is not of server/base/mutex.h\n"
            "server/b/b.cpp:1: a lock that is not of server/base/mutex.h\n");
  EXPECT_EQ(shown(check_locks(
                {{"server/a/a.h", "  Mutex mutex_;\n  int n_ TRAMMEL_GUARDED_BY(mutex_);\n"},
                 {"server/b/b.h", "  Mutex mutex_;  // one at a time\n"},
                 {"server/c/c.h", "  mutable Mutex mutex_;\n  int n_;\n"}})),
            "server/c/c.h:1: mutex_ guards nothing\n");
}

TEST(TidyChecks, ComplainOfATestFolderWithoutItsServerFolder) {
  EXPECT_EQ(
      shown(check_mirror(
          {{"server/bias/a.h", ""}, {"tests/bias/a_test.cpp", ""}, {"tests/fuzz/b.cpp", ""}})),
      "");
  EXPECT_EQ(shown(check_mirror({{"server/bias/a.h", ""}, {"tests/kernels/a_test.cpp", ""}})),
            "tests/kernels: there is no server/kernels\n");
}

}  // namespace
}  // namespace trammel
