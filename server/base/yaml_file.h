#pragma once

#include <yaml-cpp/yaml.h>

#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

/// Reads YAML that people write. Refuses unknown keys and texts with control characters. Every
/// error names the file, the key and the expected value. Only readers (`*_file.cpp`) and config/
/// include this header.
namespace trammel {

/// Thrown by YamlMap, caught by read_yaml(); never leaves a reader.
struct YamlRefusal {
  Error error;
};

/// A mapping in a file, and the path of keys to it.
class YamlMap {
 public:
  YamlMap(YAML::Node node, std::string file);

  /// Notes every key that is not in `known` as an error, and goes on.
  void only(std::initializer_list<const char*> known) const;
  /// Calls `read`. An error in it is recorded, and reading goes on: read_yaml() reports all errors
  /// at its end.
  template <typename Read>
  void attempt(const Read& read) const {
    try {
      read();
    } catch (const YamlRefusal& refusal) {
      problems_->push_back(refusal.error);
    }
  }
  /// The errors noted so far, of the whole file.
  [[nodiscard]] const std::vector<Error>& problems() const { return *problems_; }
  [[nodiscard]] bool has(const std::string& key) const;
  /// True if the key is `null` or absent.
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
  /// Line of the key, counted from 1.
  [[nodiscard]] std::optional<long> row_of(const std::string& key) const { return line_of(key); }
  [[noreturn]] void refuse(const std::string& key, const std::string& why) const;
  /// Refuses with the error `why`. File, line and the path of keys to `key` are added here.
  [[noreturn]] void refuse(const std::string& key, Failure why) const;

 private:
  YamlMap(YAML::Node node, std::string file, std::string path,
          std::shared_ptr<std::vector<Error>> problems);
  [[noreturn]] void refuse_at(std::optional<long> line, Failure why) const;
  [[nodiscard]] std::optional<long> line_of(const std::string& key) const;
  [[nodiscard]] YAML::Node at(const std::string& key) const;
  [[nodiscard]] double number_of(const YAML::Node& node, const std::string& key) const;
  [[nodiscard]] std::string plain(const std::string& text, const std::string& key) const;

  YAML::Node node_;
  std::string file_;
  std::string path_;  // the keys that led here, `tools: spindle`; empty at the top
  std::shared_ptr<std::vector<Error>> problems_;
};

/// Refuses a text that is not UTF-8, and one that is too large to be written by hand (kTooLarge):
/// over a megabyte, 20 levels of nesting, 20,000 entries or 100 aliases. Reads the text once and
/// keeps nothing. Throws the exceptions of the parser.
[[nodiscard]] Status check_yaml_limits(const std::string& text, const std::string& where);

/// Line of the text, counted from 1; empty if the parser does not know it.
[[nodiscard]] std::optional<long> line_of(const YAML::Mark& mark);
/// `column 5: `, counted from 1; empty if the parser does not know it.
[[nodiscard]] std::string column_text(const YAML::Mark& mark);
/// True if the line of the mark begins with a tab among its blanks.
[[nodiscard]] bool is_indented_by_tab(const std::string& text, const YAML::Mark& mark);

/// Parses `text` and hands its top mapping to `read`; turns refusals and parser errors into one
/// Error that holds all.
template <typename Read>
auto read_yaml(const std::string& text, const std::string& where, Read&& read)
    -> Result<decltype(read(std::declval<const YamlMap&>()))> {
  try {
    if (const Status fine = check_yaml_limits(text, where); !fine)
      return tl::make_unexpected(fine.error());
    const YamlMap map(YAML::Load(text), where);
    std::optional<decltype(read(map))> value;
    map.attempt([&] { value.emplace(read(map)); });
    if (!map.problems().empty()) return Failure(together(map.problems()));
    return std::move(*value);
  } catch (const YamlRefusal& refusal) {
    return Failure(refusal.error);
  } catch (const YAML::Exception& error) {
    Failure damaged = refused("{}not YAML: {}", column_text(error.mark), error.msg).in(where);
    damaged.value().row = line_of(error.mark);
    if (is_indented_by_tab(text, error.mark))
      damaged.value().next = "indent with blanks: YAML takes no tabs";
    return damaged;
  }
}

}  // namespace trammel
