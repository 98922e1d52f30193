#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

Parameter ratio_parameter(std::string name) { return {std::move(name), "rad/rad", 1, 0, 1e-3}; }

/// The wrist's shafts run through one another: turning joint 4 drags 5 and 6 along, turning joint 5 drags 6, in
/// proportion.
class WristCoupling final : public JointError {
 public:
  explicit WristCoupling(const SourceSpec& spec)
      : JointError(spec.text, -1, {ratio_parameter("k54"), ratio_parameter("k64"), ratio_parameter("k65")}) {}
  std::string explanation() const override { return "the wrist axes drag one another along through their gears"; }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    return {{4, 0, context.q(3)}, {5, 1, context.q(3)}, {5, 2, context.q(4)}};
  }
};

}  // namespace

Result<ErrorSourcePtr> make_wrist_coupling(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.size() != 6) {
    return refused("error source '{}' is of six-axis robots, {} has {} joints", spec.text, cell.robot.name(),
                   cell.robot.size());
  }
  return std::make_shared<WristCoupling>(spec);
}

}  // namespace trammel
