#include "clients/cli/text/notes_text.h"

#include <fmt/format.h>

#include <cstdio>

#include "server/base/plain_text.h"

namespace trammel::cli {

std::string notes_text(const std::vector<Note>& notes) {
  std::string text;
  for (const Note& note : notes)
    text +=
        fmt::format("{}: {}\n", note.severity == Note::Severity::kInfo ? "note" : to_text(note.severity), note.text);
  return text;
}

void warn_of_notes(const std::vector<Note>& notes) {
  std::vector<Note> grave;
  for (const Note& note : notes)
    if (note.severity != Note::Severity::kInfo) grave.push_back(note);
  std::fputs(shown_lines(notes_text(grave)).c_str(), stderr);
}

}  // namespace trammel::cli
