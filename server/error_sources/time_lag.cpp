#include "server/error_sources/joint_error.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

/// Measurement and commanded joints belong to different times: every joint stands where it was
/// commanded `lag` earlier.
class TimeLag final : public JointError {
 public:
  explicit TimeLag(const SourceSpec& spec)
      : JointError(spec.text, -1, {{"lag", "s", 1, 0, 0.05}}) {}
  const CauseRecord& cause() const override { return causes::time_lag(); }
  std::string explanation() const override {
    return "joints and measurement are not of the same moment";
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    std::vector<Term> all;
    if (!context.velocity) return all;
    for (int j = 0; j < static_cast<int>(context.q.size()); ++j)
      all.push_back({j, 0, -(*context.velocity)(j)});
    return all;
  }
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell&) {
  return std::make_shared<TimeLag>(spec);
}

}  // namespace

const CauseRecord& causes::time_lag() {
  static const CauseRecord record = {
      .spelling = "time_lag",
      .plain_name = "time lag between robot and tracker",
      .plain_name_of_joint = "",
      .scope = Scope::kSession,
      .lasting = Lasting::kAlways,
      .needs = {.velocity = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 5},
      .forms = {{"time_lag", make}},
      .rivals = {{.cause = "joint_slip"}, {.cause = "tracker_moved"}},
      .told_apart_by = remedies::kOtherSpeed,
      .shown_by = remedies::kOtherSpeed.text,
      .action = "trigger tracker and robot from one clock",
      .figures = {{"lag", "s", "how much later the measurement is than the joints"}},
  };
  return record;
}

}  // namespace trammel
