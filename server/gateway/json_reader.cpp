#include "server/gateway/json_reader.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "server/base/json_guard.h"

namespace trammel {
namespace {

bool is_integer(const nlohmann::json& value) {
  if (!value.is_number_integer()) return false;
  const double number = value.get<double>();
  return std::abs(number) <= std::numeric_limits<int>::max();
}

}  // namespace

Result<nlohmann::json> read_json_object(const std::string& body) {
  JsonLimits limits;
  limits.text_bytes = body.size() + 1;  // a program may be one text
  TRY(check_json_limits(body, "the body", limits));
  auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) return failure(ErrorCode::kUsage, "the body is no JSON object");
  return json;
}

JsonReader::JsonReader(const nlohmann::json& object, std::string where)
    : object_(object), where_(std::move(where)) {}

const nlohmann::json* JsonReader::find(const char* name) const {
  if (!object_.is_object()) return nullptr;
  const auto found = object_.find(name);
  return found == object_.end() || found->is_null() ? nullptr : &*found;
}

void JsonReader::refuse(const char* name, const std::string& expected) {
  if (!status_) return;
  Error wrong = failure(ErrorCode::kUsage, "'{}': expected {}", name, expected).of(name).value();
  wrong.file = where_;
  status_ = tl::make_unexpected(std::move(wrong));
}

void JsonReader::only(std::initializer_list<const char*> names) {
  if (!object_.is_object()) return refuse("", "an object");
  for (const auto& member : object_.items()) {
    const std::string& name = member.key();
    const bool known = std::any_of(names.begin(), names.end(),
                                   [&](const char* one) { return std::string_view(one) == name; });
    if (!known) refuse(name.c_str(), fmt::format("one of {}", fmt::join(names, ", ")));
  }
}

bool JsonReader::has(const char* name) const { return find(name) != nullptr; }

std::string JsonReader::text(const char* name) {
  const nlohmann::json* value = find(name);
  if (value == nullptr) return {};
  if (value->is_string()) return value->get<std::string>();
  refuse(name, "a text");
  return {};
}

bool JsonReader::flag(const char* name) {
  const nlohmann::json* value = find(name);
  if (value == nullptr) return false;
  if (value->is_boolean()) return value->get<bool>();
  refuse(name, "true or false");
  return false;
}

std::optional<double> JsonReader::number(const char* name) {
  const nlohmann::json* value = find(name);
  if (value == nullptr) return std::nullopt;
  if (value->is_number()) return value->get<double>();
  refuse(name, "a number");
  return std::nullopt;
}

std::optional<int> JsonReader::integer(const char* name) {
  const nlohmann::json* value = find(name);
  if (value == nullptr) return std::nullopt;
  if (is_integer(*value)) return value->get<int>();
  refuse(name, "a whole number");
  return std::nullopt;
}

template <typename Item>
std::vector<Item> JsonReader::items(const char* name, bool (*good)(const nlohmann::json&),
                                    const char* expected) {
  const nlohmann::json* value = find(name);
  if (value == nullptr) return {};
  if (!value->is_array() || !std::all_of(value->begin(), value->end(), good)) {
    refuse(name, expected);
    return {};
  }
  return value->get<std::vector<Item>>();
}

std::vector<double> JsonReader::numbers(const char* name) {
  return items<double>(
      name, [](const nlohmann::json& one) { return one.is_number(); }, "a list of numbers");
}

std::vector<int> JsonReader::integers(const char* name) {
  return items<int>(name, is_integer, "a list of whole numbers");
}

std::vector<std::string> JsonReader::texts(const char* name) {
  return items<std::string>(
      name, [](const nlohmann::json& one) { return one.is_string(); }, "a list of texts");
}

const nlohmann::json& JsonReader::list(const char* name) {
  static const nlohmann::json kNone = nlohmann::json::array();
  const nlohmann::json* value = find(name);
  if (value != nullptr && value->is_array()) return *value;
  refuse(name, "a list");
  return kNone;
}

}  // namespace trammel
