#pragma once

#include <algorithm>
#include <string>
#include <vector>

namespace trammel {

/// A note for the users of a result.
struct Note {
  enum class Severity {
    kInfo,
    kWarning,
    kStop  ///< a model with it is not put in force automatically: a person decides
  };
  std::string code;  ///< for programs: `robot_not_confirmed`
  Severity severity = Severity::kInfo;
  std::string text;  ///< one sentence
};

[[nodiscard]] inline const char* to_text(Note::Severity severity) {
  switch (severity) {
    case Note::Severity::kInfo:
      return "info";
    case Note::Severity::kWarning:
      return "warning";
    case Note::Severity::kStop:
      return "stop";
  }
  return "";
}

/// Sorts by severity, the gravest first; notes of one severity keep their order.
[[nodiscard]] inline std::vector<Note> gravest_first(std::vector<Note> notes) {
  std::stable_sort(notes.begin(), notes.end(),
                   [](const Note& a, const Note& b) { return a.severity > b.severity; });
  return notes;
}

}  // namespace trammel
