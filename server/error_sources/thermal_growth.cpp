#include "server/error_sources/sources.h"

namespace trammel {

namespace {

constexpr double kReferenceTemperature = 20;  // degrees Celsius, of drawings

/// Every length of the arm grows with temperature, by one coefficient. A temperature that never changes only rescales d
/// and a.
class ThermalGrowth final : public ErrorSource {
 public:
  std::string name() const override { return "thermal_growth"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  ContextNeeds needs() const override { return {.temperature = true}; }
  std::string explanation() const override { return "the links grow as they warm up"; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (!context.temperature) return;
    const double warming = *context.temperature - kReferenceTemperature;
    const double factor = 1 + values(0) * warming;
    const auto grow = [&](double& length, int row) {
      if (jacobian != nullptr) {
        jacobian->transform(row, Eigen::Matrix<double, 1, 1>(factor));
        jacobian->add(row, first_column, length * warming);
      }
      length *= factor;
    };
    for (int i = 0; i < state.chain->size(); ++i) {
      LinkGeometry& link = state.links[static_cast<std::size_t>(i)];
      const StateRows rows(state.chain->size());
      grow(link.a, rows.a(i));
      // A rail's d is where it stands, not how long something is.
      if (state.chain->joint(i).type == JointType::kRevolute) grow(link.d, rows.d(i));
    }
  }

 private:
  const std::vector<Parameter> parameters_ = {{"growth", "um/m/K", 1e6, 0, 20e-6}};
};

}  // namespace

Result<ErrorSourcePtr> make_thermal_growth(const SourceSpec&, const Cell&) { return std::make_shared<ThermalGrowth>(); }

}  // namespace trammel
