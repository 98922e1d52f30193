#include "server/report/error_json.h"

#include "server/base/plain_text.h"

namespace trammel {

nlohmann::ordered_json error_json(const Error& error) {
  nlohmann::ordered_json json = {{"code", to_text(error.code)}, {"message", error.message}};
  const auto add = [&](const char* key, const std::string& text) {
    if (!text.empty()) json[key] = text;
  };
  add("file", error.file);
  if (error.row) json["row"] = *error.row;
  add("field", error.field);
  if (error.value) json["value"] = *error.value;
  if (error.limit) json["limit"] = *error.limit;
  add("text", error.text);
  add("next", error.next);
  for (const Error& other : error.also) json["also"].push_back(error_json(other));
  json["sentence"] = sentence(error);
  return json;
}

std::string json_text(const nlohmann::ordered_json& value) {
  // JSON leaves some characters alone that can control a terminal. JSON's own escapes replace them.
  return shown_lines(value.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

}  // namespace trammel
