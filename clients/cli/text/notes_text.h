#pragma once

#include <string>
#include <vector>

#include "server/base/note.h"

namespace trammel::cli {

/// The leading notes: those that a user must know before using the model.
[[nodiscard]] std::vector<Note> grave(const std::vector<Note>& notes);
/// The others.
[[nodiscard]] std::vector<Note> for_information(const std::vector<Note>& notes);
/// A line each: `stop: ...`, `warning: ...`, `note: ...`.
[[nodiscard]] std::string notes_text(const std::vector<Note>& notes);

/// Prints the notes that no user of the model may overlook on standard error, where results for
/// programs do not hide them.
void warn_of_notes(const std::vector<Note>& notes);

}  // namespace trammel::cli
