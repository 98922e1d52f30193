#pragma once

#include <yaml-cpp/yaml.h>

#include <initializer_list>
#include <string>
#include <vector>

#include "server/base/result.h"

/// Reading YAML that people write: strict about keys, and every refusal says file, key and what was expected.
/// Included only by readers (`*_file.cpp`) and config/.
namespace trammel {

/// Thrown by YamlMap, caught by read_yaml(); never leaves a reader.
struct YamlRefusal {
  std::string message;
};

/// A mapping in a file, with the path of keys that led to it.
class YamlMap {
 public:
  YamlMap(YAML::Node node, std::string where);

  /// Refuses keys that are not in `known`.
  void only(std::initializer_list<const char*> known) const;
  [[nodiscard]] bool has(const std::string& key) const;
  /// Present and `null` (or absent).
  [[nodiscard]] bool is_null(const std::string& key) const;
  [[nodiscard]] double number(const std::string& key) const;
  [[nodiscard]] double number(const std::string& key, double otherwise) const;
  [[nodiscard]] int integer(const std::string& key, int otherwise) const;
  [[nodiscard]] bool boolean(const std::string& key, bool otherwise) const;
  [[nodiscard]] std::string text(const std::string& key) const;
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise) const;
  [[nodiscard]] std::vector<double> numbers(const std::string& key, std::size_t count) const;
  [[nodiscard]] std::vector<std::string> texts(const std::string& key) const;
  [[nodiscard]] YamlMap map(const std::string& key) const;
  [[nodiscard]] std::vector<YamlMap> maps(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> keys() const;
  [[noreturn]] void refuse(const std::string& key, const std::string& why) const;

 private:
  [[nodiscard]] YAML::Node at(const std::string& key) const;
  [[nodiscard]] double number_of(const YAML::Node& node, const std::string& key) const;

  YAML::Node node_;
  std::string where_;
};

/// Parses `text` and hands its top mapping to `read`; turns refusals and parser errors into an Error.
template <typename Read>
auto read_yaml(const std::string& text, const std::string& where, Read&& read)
    -> Result<decltype(read(std::declval<const YamlMap&>()))> {
  try {
    return read(YamlMap(YAML::Load(text), where));
  } catch (const YamlRefusal& refusal) {
    return refused("{}", refusal.message);
  } catch (const YAML::Exception& error) {
    return refused("{}: not YAML: {}", where, error.what());
  }
}

}  // namespace trammel
