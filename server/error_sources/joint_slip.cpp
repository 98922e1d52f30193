#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// A joint loses its zero at a pose and keeps the new one.
class JointSlip final : public JointError {
 public:
  explicit JointSlip(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {angle_parameter(fmt::format("slip{}@{:.0f}", spec.joint + 1, spec.at[0]), 2e-3)}),
        first_(static_cast<int>(spec.at[0]) - 1) {}
  std::string explanation() const override {
    return fmt::format("joint {} lost its zero at pose {}", joint() + 1, first_ + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    if (!context.from(first_)) return {};
    return {{joint(), 0, 1.0}};
  }
  const int first_;
};

}  // namespace

Result<ErrorSourcePtr> make_joint_slip(const SourceSpec& spec, const Cell&) {
  return std::make_shared<JointSlip>(spec);
}

}  // namespace trammel
