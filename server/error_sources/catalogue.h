#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/error_sources/cause.h"

/// The causes that are known: those that ship (shipped_causes.h) and whatever a program adds. Thread-safe.
namespace trammel {

/// All of them, in the order in which diagnosis looks for them.
[[nodiscard]] std::vector<const CauseRecord*> all_causes();

/// The cause of a spelling: of the cause, of one of its forms, or of a source in a list (`joint_slip:2@40`). Null where
/// none is known by it.
[[nodiscard]] const CauseRecord* find_cause(std::string_view spelling);

/// The same where it must be known: anything else is a bug.
[[nodiscard]] const CauseRecord& cause_spelled(std::string_view spelling);

/// The first that is looked for like this. A bug where there is none.
[[nodiscard]] const CauseRecord& first_searched_by(causes::SearchFamily family);

/// What a record does not say and ought to, in words for its author; empty where it is complete. Its rivals are held
/// against the causes that are known.
[[nodiscard]] std::vector<std::string> missing_in(const CauseRecord& record);

/// A cause that is known besides those that ship, after them, for as long as this lives. `record` must outlive
/// everything that is made meanwhile; no other cause may be spelled like it or like one of its forms.
class AddedCause {
 public:
  explicit AddedCause(const CauseRecord& record);
  ~AddedCause();
  AddedCause(const AddedCause&) = delete;
  AddedCause& operator=(const AddedCause&) = delete;

 private:
  const CauseRecord& record_;
};

}  // namespace trammel
