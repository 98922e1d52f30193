#include "server/base/yaml_file.h"

#include <algorithm>
#include <cmath>

namespace trammel {

YamlMap::YamlMap(YAML::Node node, std::string where) : node_(std::move(node)), where_(std::move(where)) {
  if (!node_.IsMap()) throw YamlRefusal{fmt::format("{}: expected keys and values", where_)};
}

void YamlMap::refuse(const std::string& key, const std::string& why) const {
  throw YamlRefusal{fmt::format("{}: {}: {}", where_, key, why)};
}

void YamlMap::only(std::initializer_list<const char*> known) const {
  std::string list;
  for (const char* name : known) list += fmt::format("{}{}", list.empty() ? "" : " ", name);
  for (const std::string& key : keys()) {
    if (std::none_of(known.begin(), known.end(), [&](const char* name) { return key == name; })) {
      refuse(key, fmt::format("unknown key; known here: {}", list));
    }
  }
}

std::vector<std::string> YamlMap::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) refuse("?", "a key that is not a word");
    if (std::find(names.begin(), names.end(), entry.first.Scalar()) != names.end()) {
      refuse(entry.first.Scalar(), "given twice");
    }
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
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value)) refuse(key, "expected a number");
  if (!std::isfinite(value)) refuse(key, fmt::format("{} is not finite", node.Scalar()));
  return value;
}

double YamlMap::number(const std::string& key) const { return number_of(at(key), key); }
double YamlMap::number(const std::string& key, double otherwise) const { return has(key) ? number(key) : otherwise; }

int YamlMap::integer(const std::string& key, int otherwise) const {
  if (!has(key)) return otherwise;
  int value = 0;
  if (!at(key).IsScalar() || !YAML::convert<int>::decode(at(key), value)) refuse(key, "expected a whole number");
  return value;
}

bool YamlMap::boolean(const std::string& key, bool otherwise) const {
  if (!has(key)) return otherwise;
  bool value = false;
  if (!at(key).IsScalar() || !YAML::convert<bool>::decode(at(key), value)) refuse(key, "expected true or false");
  return value;
}

std::string YamlMap::text(const std::string& key) const {
  if (!at(key).IsScalar()) refuse(key, "expected a text");
  return at(key).Scalar();
}
std::string YamlMap::text(const std::string& key, const std::string& otherwise) const {
  return has(key) ? text(key) : otherwise;
}

std::vector<double> YamlMap::numbers(const std::string& key, std::size_t count) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence() || node.size() != count) refuse(key, fmt::format("expected a list of {} numbers", count));
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
    values.push_back(item.Scalar());
  }
  return values;
}

YamlMap YamlMap::map(const std::string& key) const { return {at(key), where_ + ": " + key}; }

std::vector<YamlMap> YamlMap::maps(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsSequence()) refuse(key, "expected a list");
  std::vector<YamlMap> list;
  for (std::size_t i = 0; i < node.size(); ++i)
    list.emplace_back(node[i], fmt::format("{}: {} {}", where_, key, i + 1));
  return list;
}

}  // namespace trammel
