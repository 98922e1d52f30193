#include "server/error_sources/shipped_causes.h"
#include "server/error_sources/warming.h"

namespace trammel {

namespace {

/// Every length of the arm grows with the temperature of its links, which follows the recorded
/// temperature with a lag. Without a lag the cause is `thermal_growth`.
class LaggedGrowth final : public ErrorSource {
 public:
  const CauseRecord& cause() const override { return causes::lagged_growth(); }
  std::string name() const override { return "lagged_growth"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the links grow as they warm up, later than the thermometer";
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const std::optional<Warming> felt = warming_at(context, values(1));
    if (!felt) return;
    const double factor = 1 + values(0) * felt->kelvin;
    const StateRows rows(state.chain->size());
    const auto grow = [&](double& length, int row) {
      if (jacobian != nullptr) {
        jacobian->transform(row, Eigen::Matrix<double, 1, 1>(factor));
        jacobian->add(row, first_column, length * felt->kelvin);
        jacobian->add(row, first_column + 1, length * values(0) * felt->by_lag);
      }
      length *= factor;
    };
    for (int i = 0; i < state.chain->size(); ++i) {
      LinkGeometry& link = state.links[static_cast<std::size_t>(i)];
      grow(link.a, rows.a(i));
      // The d of a rail is a position, not a length: it does not grow.
      if (state.chain->joint(i).type == JointType::kRevolute) grow(link.d, rows.d(i));
    }
  }

 private:
  const std::vector<Parameter> parameters_ = {{"growth", "um/m/K", 1e6, 0, 20e-6},
                                              heat_lag_parameter("heat_lag")};
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell&) {
  return std::make_shared<LaggedGrowth>();
}

}  // namespace

const CauseRecord& causes::lagged_growth() {
  static const CauseRecord record = {
      .spelling = "lagged_growth",
      .plain_name = "thermal growth with lag",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {.temperature = true, .history = true},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kLinks, 2},
      .forms = {{"lagged_growth", make}},
      .rivals = {{.cause = "thermal_growth"},
                 {.cause = "thermal_zero"},
                 {.cause = "tracker_drift"}},
      .told_apart_by = remedies::kOtherTemperature,
      .shown_by = "temperature and time of every pose, over a warm-up and a cooling",
      .action = "warm the robot up before work, or record its temperature with every job",
      .figures = {{"growth", "um/m/K", "growth of every link"},
                  {"heat_lag", "min",
                   "how long the links take to follow the recorded temperature"}},
  };
  return record;
}

}  // namespace trammel
