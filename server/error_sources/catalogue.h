#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/error_sources/cause.h"

/// The known causes: the shipped ones (shipped_causes.h) and the ones that a program adds.
/// Thread-safe.
namespace trammel {

/// All causes, in the order in which diagnosis looks for them.
[[nodiscard]] std::vector<const CauseRecord*> all_causes();

/// The cause that `spelling` names. It may be the spelling of the cause, of one of its forms, or of
/// a source in a list (`joint_slip:2@40`). Null if it is unknown.
[[nodiscard]] const CauseRecord* find_cause(std::string_view spelling);

/// The record of a spelling that must be known: an unknown one is a bug.
[[nodiscard]] const CauseRecord& cause_spelled(std::string_view spelling);

/// The first cause with that search family. A missing one is a bug.
[[nodiscard]] const CauseRecord& first_searched_by(causes::SearchFamily family);

/// The first record that stands for `what`. A missing record is a bug.
[[nodiscard]] const CauseRecord& cause_that_stands_for(causes::StandsFor what);

/// The cause whose parameters correct that part of the nominal cell. A missing one is a bug.
[[nodiscard]] const CauseRecord& cause_correcting(causes::Part part);

/// The gaps in a record, in words for its author; empty if it is complete. Its rivals must
/// be known causes.
[[nodiscard]] std::vector<std::string> missing_in(const CauseRecord& record);

/// Registers a cause after the shipped ones, until this object is destroyed. `record` must outlive
/// everything that is made in that time. The spellings of the cause and of its forms must be new.
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
