#include "server/error_sources/frame_motion.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kSecondsPerHour = 3600;

/// From a pose on, the tracker stands elsewhere: everything it sees has moved as one. It is
/// described as the base moving in W, with its rotation about the origin of B.
class TrackerMoved final : public ErrorSource {
 public:
  explicit TrackerMoved(const SourceSpec& spec)
      : name_(spec.text), first_(static_cast<int>(spec.at[0]) - 1) {
    for (const char* name : {"mx", "my", "mz"}) {
      parameters_.push_back(length_parameter(fmt::format("{}@{}", name, first_ + 1), 0.5));
    }
    for (const char* name : {"mrz", "mry", "mrx"}) {
      parameters_.push_back(angle_parameter(fmt::format("{}@{}", name, first_ + 1), 5e-4));
    }
  }
  const CauseRecord& cause() const override { return causes::tracker_moved(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("the tracker (or the robot's base) moved before pose {}", first_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (!context.served && context.index >= first_)
      move_base_in_world(values, 1, state, jacobian, first_column);
  }

 private:
  std::string name_;
  int first_;
  std::vector<Parameter> parameters_;
};

/// The tracker creeps: the same motion in proportion to the time since the first pose.
class TrackerDrift final : public ErrorSource {
 public:
  const CauseRecord& cause() const override { return causes::tracker_drift(); }
  std::string name() const override { return "tracker_drift"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the tracker creeps as time goes on"; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (!context.served && context.time)
      move_base_in_world(values, *context.time / kSecondsPerHour, state, jacobian, first_column);
  }

 private:
  static Parameter length_rate(std::string name) {
    return {std::move(name), "mm/h", to_mm(1), 0, from_mm(0.2)};
  }
  static Parameter angle_rate(std::string name) { return {std::move(name), "rad/h", 1, 0, 2e-4}; }
  const std::vector<Parameter> parameters_ = {length_rate("dx"), length_rate("dy"),
                                              length_rate("dz"), angle_rate("drz"),
                                              angle_rate("dry"), angle_rate("drx")};
};

Result<ErrorSourcePtr> make_tracker_moved(const SourceSpec& spec, const Cell&) {
  return std::make_shared<TrackerMoved>(spec);
}
Result<ErrorSourcePtr> make_tracker_drift(const SourceSpec&, const Cell&) {
  return std::make_shared<TrackerDrift>();
}

}  // namespace

const CauseRecord& causes::tracker_moved() {
  static const CauseRecord record = {
      .spelling = "tracker_moved",
      .plain_name = "the tracker moved",
      .plain_name_of_joint = "",
      .scope = Scope::kSession,
      .lasting = Lasting::kFromAPose,
      .needs = {},
      .search = SearchFamily::kStep,
      .acts = {ActsOn::kBase, 2},
      .forms = {{"tracker_moved", make_tracker_moved}},
      .rivals = {{.cause = "base", .likeness = Likeness::kFromTheFirstPose},
                 {.cause = "tracker_drift"},
                 {.cause = "joint_slip"}},
      .told_apart_by = remedies::kReflectors,
      .shown_by = "reference reflectors, measured before and after",
      .action =
          "fix the tracker (or the robot's base) to the floor and measure the reference reflectors",
      .figures = {{"mx", "mm", "what was measured moved along x"},
                  {"my", "mm", "along y"},
                  {"mz", "mm", "along z"},
                  {"mrz", "rad", "what was measured turned about z"},
                  {"mry", "rad", "about y"},
                  {"mrx", "rad", "about x"}},
      .goes_with_time = true,
      .whole_batch = WholeBatch{"the tracker, or the robot's base, stands elsewhere", false},
      .example = Example{3, -1},
  };
  return record;
}

const CauseRecord& causes::tracker_drift() {
  static const CauseRecord record = {
      .spelling = "tracker_drift",
      .plain_name = "tracker drift",
      .plain_name_of_joint = "",
      .scope = Scope::kSession,
      .lasting = Lasting::kOfTheSession,
      .needs = {.time = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kBase, 1},
      .forms = {{"tracker_drift", make_tracker_drift}},
      .rivals = {{.cause = "tracker_moved"}, {.cause = "thermal_growth"}},
      .told_apart_by = remedies::kReflectors,
      .shown_by = remedies::kReflectors.text,
      .action = "let the tracker warm up, and measure reference reflectors in between",
      .figures = {{"dx", "mm/h", "what is measured creeps along x"},
                  {"dy", "mm/h", "along y"},
                  {"dz", "mm/h", "along z"},
                  {"drz", "rad/h", "what is measured turns about z"},
                  {"dry", "rad/h", "about y"},
                  {"drx", "rad/h", "about x"}},
      .goes_with_time = true,
  };
  return record;
}

}  // namespace trammel
