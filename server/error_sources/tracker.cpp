#include "server/error_sources/frame_motion.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

constexpr double kSecondsPerHour = 3600;

/// From a pose on, the tracker stands elsewhere: everything it sees has moved as one. Told by the base moving in W,
/// with its rotation about the origin of B.
class TrackerMoved final : public ErrorSource {
 public:
  explicit TrackerMoved(const SourceSpec& spec) : name_(spec.text), first_(static_cast<int>(spec.at[0]) - 1) {
    for (const char* name : {"mx", "my", "mz"}) {
      parameters_.push_back(length_parameter(fmt::format("{}@{}", name, first_ + 1), 0.5));
    }
    for (const char* name : {"mrz", "mry", "mrx"}) {
      parameters_.push_back(angle_parameter(fmt::format("{}@{}", name, first_ + 1), 5e-4));
    }
  }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("the tracker (or the robot's base) moved before pose {}", first_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (!context.served && context.index >= first_) move_base_in_world(values, 1, state, jacobian, first_column);
  }

 private:
  std::string name_;
  int first_;
  std::vector<Parameter> parameters_;
};

/// The tracker creeps: the same motion in proportion to the time since the first pose.
class TrackerDrift final : public ErrorSource {
 public:
  std::string name() const override { return "tracker_drift"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  ContextNeeds needs() const override { return {.time = true}; }
  std::string explanation() const override { return "the tracker creeps as time goes on"; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (!context.served && context.time)
      move_base_in_world(values, *context.time / kSecondsPerHour, state, jacobian, first_column);
  }

 private:
  static Parameter length_rate(std::string name) { return {std::move(name), "mm/h", to_mm(1), 0, from_mm(0.2)}; }
  static Parameter angle_rate(std::string name) { return {std::move(name), "rad/h", 1, 0, 2e-4}; }
  const std::vector<Parameter> parameters_ = {length_rate("dx"), length_rate("dy"), length_rate("dz"),
                                              angle_rate("drz"), angle_rate("dry"), angle_rate("drx")};
};

}  // namespace

Result<ErrorSourcePtr> make_tracker_moved(const SourceSpec& spec, const Cell&) {
  return std::make_shared<TrackerMoved>(spec);
}
Result<ErrorSourcePtr> make_tracker_drift(const SourceSpec&, const Cell&) { return std::make_shared<TrackerDrift>(); }

}  // namespace trammel
