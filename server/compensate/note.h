#pragma once

#include <string>

namespace trammel {

/// What a note asks of its reader.
enum class Severity {
  kNote,   ///< good to know
  kLeads,  ///< stands first: the figures mean less than they seem to
  kHolds   ///< the model waits for a person: no server puts it in force by itself
};
/// `note`, `leads`, `holds`, as files have it.
[[nodiscard]] std::string to_string(Severity severity);

/// Something that whoever uses a result should know.
struct Note {
  std::string code;  ///< for programs; it stays the same when the words get better
  Severity severity = Severity::kNote;
  std::string text;  ///< for people: one sentence without its full stop
};

}  // namespace trammel
