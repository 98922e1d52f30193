#include "server/error_sources/shipped_causes.h"

namespace trammel {

const CauseRecord& causes::outlier() {
  static const CauseRecord record = {
      .spelling = "outlier",
      .plain_name = "single bad pose",
      .plain_name_of_joint = "",
      .scope = Scope::kPose,
      .lasting = Lasting::kOfTheSession,
      .needs = {},
      .search = SearchFamily::kPose,
      .acts = {},
      .forms = {},
      .rivals = {{.cause = "tracker_moved"}, {.cause = "tool_changed"}},
      .told_apart_by = {90, "the pose and its neighbours, measured again"},
      .shown_by = "more poses",
      .action = "single pose, cause not separable: repeat it and its neighbours",
      .figures = {{"distance", "mm", "how far it is from where the others say"}},
  };
  return record;
}

}  // namespace trammel
