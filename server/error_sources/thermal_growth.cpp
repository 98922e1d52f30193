#include <algorithm>

#include "server/error_sources/error_source.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kReferenceTemperature = 20;  // degrees Celsius, of drawings

/// Every length of the arm grows with temperature, by one coefficient. A temperature that never
/// changes only rescales d and a.
class ThermalGrowth final : public ErrorSource {
 public:
  const CauseRecord& cause() const override { return causes::thermal_growth(); }
  std::string name() const override { return "thermal_growth"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the links grow as they warm up"; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
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
      // The d of a rail is a position, not a length: it does not grow.
      if (state.chain->joint(i).type == JointType::kRevolute) grow(link.d, rows.d(i));
    }
  }

 private:
  const std::vector<Parameter> parameters_ = {{"growth", "um/m/K", 1e6, 0, 20e-6}};
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell&) {
  return std::make_shared<ThermalGrowth>();
}

}  // namespace

const CauseRecord& causes::thermal_growth() {
  static const CauseRecord record = {
      .spelling = "thermal_growth",
      .plain_name = "thermal growth",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {.temperature = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLinks, 1},
      .forms = {{"thermal_growth", make}},
      .rivals = {{.cause = "geometry", .likeness = Likeness::kWhereConstant},
                 {.cause = "tracker_drift"}},
      .told_apart_by = remedies::kOtherTemperature,
      .shown_by = "temperatures that differ between poses and do not only rise with time",
      .action = "warm the robot up before work, or record its temperature with every job",
      .figures = {{"growth", "um/m/K", "growth of every link"}},
      .goes_with_time = true,
      .added_by_data =
          AddedByData{.beside = "geometry",
                      .is_known =
                          [](const Cell& cell) {
                            const auto& sources = cell.model.error_sources;
                            return std::find(sources.begin(), sources.end(), "thermal_growth") !=
                                   sources.end();
                          },
                      .note =
                          "the arm was longer in warmer sessions: its links grow with the recorded "
                          "temperature (thermal_growth), which the cell file does not list"},
  };
  return record;
}

}  // namespace trammel
