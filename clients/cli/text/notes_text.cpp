#include "clients/cli/text/notes_text.h"

#include <fmt/format.h>

#include <cstdio>

#include "server/base/plain_text.h"

namespace trammel::cli {

std::vector<Note> grave(const std::vector<Note>& notes) {
  std::vector<Note> all = notes;
  std::erase_if(all, [](const Note& note) { return note.severity == Note::Severity::kInfo; });
  return all;
}

std::vector<Note> for_information(const std::vector<Note>& notes) {
  std::vector<Note> all = notes;
  std::erase_if(all, [](const Note& note) { return note.severity != Note::Severity::kInfo; });
  return all;
}

std::string notes_text(const std::vector<Note>& notes) {
  std::string text;
  for (const Note& note : notes)
    text += fmt::format("{}: {}\n",
                        note.severity == Note::Severity::kInfo ? "note" : to_text(note.severity),
                        note.text);
  return text;
}

void warn_of_notes(const std::vector<Note>& notes) {
  std::fputs(shown_lines(notes_text(grave(notes))).c_str(), stderr);
}

}  // namespace trammel::cli
