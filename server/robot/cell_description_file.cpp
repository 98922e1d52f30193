#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

#include "server/base/hash.h"
#include "server/robot/cell_description.h"

namespace trammel {
namespace {

constexpr std::size_t kHashDigits = 32;

/// Keys of a cell file that decide no number: the robot file counts by its content, and the others
/// are for people.
const std::set<std::string> kWithoutNumbers = {
    "robot",    "robot_confirmed", "serial_number", "instrument", "instrument_certificate",
    "operator", "obstacles"};

/// `0.10` and `1e-1` are one number.
std::string spelled(const std::string& scalar) {
  double number = 0;
  const char* end = scalar.data() + scalar.size();
  const auto [stopped, error] = std::from_chars(scalar.data(), end, number);
  return error == std::errc() && stopped == end ? fmt::format("{:.17g}", number) : scalar;
}

/// One spelling for values with the same meaning. Texts carry their length, so different texts
/// never have the same spelling.
std::string spelled(const YAML::Node& node) {
  if (node.IsSequence()) {
    std::string text = "[";
    for (const YAML::Node& one : node) text += spelled(one);
    return text + "]";
  }
  if (node.IsMap()) {
    std::map<std::string, std::string> sorted;
    for (const auto& entry : node) sorted[entry.first.as<std::string>("")] = spelled(entry.second);
    std::string text = "{";
    for (const auto& [key, value] : sorted) text += fmt::format("{}:{}={}", key.size(), key, value);
    return text + "}";
  }
  if (node.IsNull()) return "~";
  const std::string scalar = spelled(node.as<std::string>(""));
  return fmt::format("{}:{}", scalar.size(), scalar);
}

std::string hash_of(const std::string& text, const std::set<std::string>& left_out) {
  std::string content = text;
  try {
    YAML::Node file = YAML::Load(text);
    if (file.IsMap()) {
      for (const std::string& key : left_out) file.remove(key);
    }
    content = spelled(file);
  } catch (const YAML::Exception&) {  // the reader of the file has refused it already
  }
  return sha256_hex(content).substr(0, kHashDigits);
}

}  // namespace

CellDescription description_of(const Cell& cell) {
  return {hash_of(cell.cell_yaml, kWithoutNumbers), hash_of(cell.robot_yaml, {})};
}

std::string what_differs(const CellDescription& a, const CellDescription& b) {
  if (a.cell == b.cell) return a.robot == b.robot ? "" : "robot file";
  return a.robot == b.robot ? "cell file" : "cell file and robot file";
}

}  // namespace trammel
