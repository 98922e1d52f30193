#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/base/note.h"

namespace trammel {

/// `"notes"` of every result that rests on a model: `[{"code", "severity", "text"}]`.
[[nodiscard]] inline nlohmann::ordered_json notes_json(const std::vector<Note>& notes) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Note& note : notes)
    list.push_back(
        {{"code", note.code}, {"severity", to_text(note.severity)}, {"text", note.text}});
  return list;
}

}  // namespace trammel
