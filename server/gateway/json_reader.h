#pragma once

#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The JSON object of a body. Refuses (kUsage) what is not one, and (kTooLarge) what is beyond the
/// limits of json_guard.h.
[[nodiscard]] Result<nlohmann::json> read_json_object(const std::string& body);

/// The members of an object from outside. The first member that is not as expected decides
/// status(); reading goes on with neutral values.
class JsonReader {
 public:
  /// `where`: the item, for errors: `target 4`; empty: the body itself. `object` outlives it.
  JsonReader(const nlohmann::json& object, std::string where);

  /// Refuses members with other names, and everything that is no object.
  void only(std::initializer_list<const char*> names);
  [[nodiscard]] bool has(const char* name) const;
  [[nodiscard]] std::string text(const char* name);  ///< empty: it has none
  [[nodiscard]] bool flag(const char* name);         ///< false: it has none
  [[nodiscard]] std::optional<double> number(const char* name);
  [[nodiscard]] std::optional<int> integer(const char* name);
  [[nodiscard]] std::vector<double> numbers(const char* name);
  [[nodiscard]] std::vector<int> integers(const char* name);
  [[nodiscard]] std::vector<std::string> texts(const char* name);
  /// Refuses a list that is missing.
  [[nodiscard]] const nlohmann::json& list(const char* name);
  void refuse(const char* name, const std::string& expected);

  [[nodiscard]] const Status& status() const { return status_; }

 private:
  [[nodiscard]] const nlohmann::json* find(const char* name) const;
  template <typename Item>
  [[nodiscard]] std::vector<Item> items(const char* name, bool (*good)(const nlohmann::json&),
                                        const char* expected);

  const nlohmann::json& object_;
  const std::string where_;
  Status status_;
};

}  // namespace trammel
