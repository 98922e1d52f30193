#include "server/base/yaml_file.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "server/base/near_miss.h"
#include "server/base/plain_text.h"

namespace trammel {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr int kMostDepth = 20;
constexpr int kMostEntries = 20'000;
constexpr int kMostAliases = 100;
constexpr double kLargestNumber = 1e12;

/// Counts the nodes that the parser meets and stops it at the limits.
class Counter final : public YAML::EventHandler {
 public:
  explicit Counter(const std::string& where) : where_(where) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override { entry(); }
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {
    within("aliases", ++aliases_, kMostAliases);
  }
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {
    entry();
  }
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    deeper();
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    deeper();
  }
  void OnMapEnd() override { --depth_; }

 private:
  void entry() { within("entries", ++entries_, kMostEntries); }
  void deeper() {
    entry();
    within("lists and mappings inside one another", ++depth_, kMostDepth);
  }
  void within(const char* what, int count, int limit) const {
    if (count <= limit) return;
    throw YamlRefusal{failure(ErrorCode::kTooLarge, "{} {}, limit {}", count, what, limit)
                          .in(where_)
                          .beyond(count, limit)
                          .value()};
  }

  const std::string& where_;
  int depth_ = 0, entries_ = 0, aliases_ = 0;
};

std::string below(const std::string& path, const std::string& key) {
  return path.empty() ? key : path + ": " + key;
}

/// The error `expected a number`, with the value that was found instead.
Failure expected(const char* what, const YAML::Node& found) {
  if (!found.IsScalar() || found.Scalar().empty()) return refused("expected {}", what);
  return refused("'{}', expected {}", found.Scalar(), what).with_text(found.Scalar());
}

}  // namespace

Status check_yaml_limits(const std::string& text, const std::string& where) {
  if (text.size() > kMostBytes) {
    return failure(ErrorCode::kTooLarge, "{} bytes, limit {}", text.size(), kMostBytes)
        .in(where)
        .beyond(text.size(), kMostBytes);
  }
  if (!is_utf8(text)) return refused("not UTF-8 text").in(where);
  if (text.find_first_not_of(" \t\r\n") != std::string::npos &&
      text[text.find_first_not_of(" \t\r\n")] == '<') {
    const bool is_urdf = text.find("<robot") != std::string::npos;
    return refused("not YAML but {}", is_urdf ? "a URDF" : "XML")
        .in(where)
        .next(is_urdf ? "write the arm as a YAML file with a DH row for each joint "
                        "(models/README.md); the shipped robots stand in models"
                      : "name the YAML file");
  }
  std::istringstream stream(text);
  Counter counter(where);
  try {
    YAML::Parser(stream).HandleNextDocument(counter);
  } catch (const YamlRefusal& refusal) {
    return Failure(refusal.error);
  }
  return {};
}

YamlMap::YamlMap(YAML::Node node, std::string file)
    : YamlMap(std::move(node), std::move(file), "", std::make_shared<std::vector<Error>>()) {}

YamlMap::YamlMap(YAML::Node node, std::string file, std::string path,
                 std::shared_ptr<std::vector<Error>> problems)
    : node_(std::move(node)),
      file_(std::move(file)),
      path_(std::move(path)),
      problems_(std::move(problems)) {
  if (!node_.IsMap())
    refuse_at(trammel::line_of(node_.Mark()), refused("expected keys and values"));
}

std::optional<long> line_of(const YAML::Mark& mark) {
  if (mark.is_null()) return std::nullopt;
  return mark.line + 1;
}

bool is_indented_by_tab(const std::string& text, const YAML::Mark& mark) {
  std::istringstream lines(text);
  std::string line;
  for (int k = 0; k <= mark.line && std::getline(lines, line);) ++k;
  return line.substr(0, line.find_first_not_of(" \t")).find('\t') != std::string::npos;
}

std::string column_text(const YAML::Mark& mark) {
  return mark.is_null() ? std::string() : fmt::format("column {}: ", mark.column + 1);
}

std::optional<long> YamlMap::line_of(const std::string& key) const {
  for (const auto& entry : node_) {
    if (entry.first.IsScalar() && entry.first.Scalar() == key)
      return trammel::line_of(entry.first.Mark());
  }
  return trammel::line_of(node_.Mark());
}

void YamlMap::refuse_at(std::optional<long> line, Failure why) const {
  if (!why.value().row) why.value().row = line;
  throw YamlRefusal{
      (path_.empty() ? std::move(why) : std::move(why).under(path_)).in(file_).value()};
}

void YamlMap::refuse(const std::string& key, const std::string& why) const {
  refuse(key, refused("{}", why));
}

void YamlMap::refuse(const std::string& key, Failure why) const {
  refuse_at(line_of(key), std::move(why).under(key));
}

void YamlMap::only(std::initializer_list<const char*> known) const {
  const std::vector<std::string> names(known.begin(), known.end());
  attempt([&] {
    for (const std::string& key : keys()) {
      if (std::find(names.begin(), names.end(), key) != names.end()) continue;
      attempt([&] {
        refuse(key, refused("unknown key{}", did_you_mean(key, names))
                        .next(fmt::format("known here: {}", fmt::join(names, " "))));
      });
    }
  });
}

std::vector<std::string> YamlMap::keys() const {
  std::vector<std::string> names;
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) refuse("?", "a key that is not a word");
    if (!is_plain(entry.first.Scalar()))
      refuse(entry.first.Scalar(), "a key with control characters");
    if (!seen.insert(entry.first.Scalar()).second) refuse(entry.first.Scalar(), "given twice");
    names.push_back(entry.first.Scalar());
  }
  return names;
}

bool YamlMap::has(const std::string& key) const { return node_[key].IsDefined(); }
bool YamlMap::is_null(const std::string& key) const { return !has(key) || node_[key].IsNull(); }

YAML::Node YamlMap::at(const std::string& key) const {
  const YAML::Node node = node_[key];
  if (!node.IsDefined()) refuse(key, "missing");
  return node;
}

double YamlMap::number_of(const YAML::Node& node, const std::string& key) const {
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value))
    refuse(key, expected("a number", node));
  if (!std::isfinite(value))
    refuse(key, refused("{} is not finite", node.Scalar()).with_text(node.Scalar()));
  if (std::abs(value) > kLargestNumber)
    refuse(key, refused("{:g}, limit {:g}", value, kLargestNumber).beyond(value, kLargestNumber));
  return value;
}

double YamlMap::number(const std::string& key) const { return number_of(at(key), key); }
double YamlMap::number(const std::string& key, double otherwise) const {
  return has(key) ? number(key) : otherwise;
}

int YamlMap::integer(const std::string& key, int otherwise) const {
  if (!has(key)) return otherwise;
  int value = 0;
  if (!at(key).IsScalar() || !YAML::convert<int>::decode(at(key), value))
    refuse(key, expected("a whole number", at(key)));
  return value;
}

bool YamlMap::boolean(const std::string& key, bool otherwise) const {
  if (!has(key)) return otherwise;
  bool value = false;
  if (!at(key).IsScalar() || !YAML::convert<bool>::decode(at(key), value))
    refuse(key, expected("true or false", at(key)));
  return value;
}

std::string YamlMap::plain(const std::string& text, const std::string& key) const {
  if (!is_plain(text))
    refuse(key, refused("'{}' has control characters", shown_short(text)).with_text(shown(text)));
  return text;
}

std::string YamlMap::text(const std::string& key) const {
  if (!at(key).IsScalar()) refuse(key, "expected a text");
  return plain(at(key).Scalar(), key);
}
std::string YamlMap::text(const std::string& key, const std::string& otherwise) const {
  return has(key) ? text(key) : otherwise;
}

std::vector<double> YamlMap::numbers(const std::string& key, std::size_t count) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence() || node.size() != count) {
    refuse(key, refused("expected a list of {} numbers", count)
                    .beyond(node.IsSequence() ? node.size() : 0, count));
  }
  std::vector<double> values;
  for (const YAML::Node& item : node) values.push_back(number_of(item, key));
  return values;
}

std::vector<std::string> YamlMap::texts(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence()) refuse(key, "expected a list");
  std::vector<std::string> values;
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) refuse(key, "expected a list of texts");
    values.push_back(plain(item.Scalar(), key));
  }
  return values;
}

YamlMap YamlMap::map(const std::string& key) const {
  return {at(key), file_, below(path_, key), problems_};
}

std::vector<YamlMap> YamlMap::maps(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence()) refuse(key, "expected a list");
  std::vector<YamlMap> list;
  for (std::size_t i = 0; i < node.size(); ++i)
    list.push_back(
        YamlMap(node[i], file_, below(path_, fmt::format("{} {}", key, i + 1)), problems_));
  return list;
}

}  // namespace trammel
