#include "server/error_sources/shipped_causes.h"

/// The record for an arm that the model in force no longer describes. No error source belongs to
/// it.
namespace trammel {

const CauseRecord& causes::drift() {
  static const CauseRecord record = {
      .spelling = "drift",
      .plain_name = "the arm itself has changed",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {},
      .forms = {},
      .rivals = {{.cause = "tracker_moved"}, {.cause = "tool_changed"}, {.cause = "joint_slip"}},
      .told_apart_by = {95, "poses over the whole range of the joints, and a diagnosis of them"},
      .shown_by = "poses over the whole range of the joints",
      .action = "train again from poses over the whole range of the joints",
      .figures = {{"effect_rms", "mm", "how far the arm is from where the model in force has it"}},
      .stands_for = StandsFor::kArmNotAsModelled,
  };
  return record;
}

}  // namespace trammel
