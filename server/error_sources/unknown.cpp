#include "server/error_sources/shipped_causes.h"

/// The record of effects that no known cause explains. No error source describes it.
namespace trammel {

const CauseRecord& causes::unknown() {
  static const CauseRecord record = {
      .spelling = "unknown",
      .plain_name = "something unknown",
      .plain_name_of_joint = "something unknown in joint {}",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {},
      .forms = {},
      .rivals = {{.cause = "joint_map"}},
      .told_apart_by = {99, "more poses, with times, temperatures and approach directions"},
      .shown_by = "more poses, with times, temperatures and approach directions",
      .action = "find out what depends on the joints that are named",
      .figures = {{"rms", "mm", "how much of the error it is"}},
      .stands_for = StandsFor::kNoKnownCause,
  };
  return record;
}

}  // namespace trammel
