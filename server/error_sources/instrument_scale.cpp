#include <utility>

#include "server/error_sources/error_source.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kReferenceTemperature = 20;  // degrees Celsius
constexpr double kPartsPerMillion = 1e6;

/// The instrument measures distances too long: by a constant share, by a share that grows with the
/// distance (bend), and by a share that grows with the air temperature. A point at p appears at p +
/// e (p - p_0), where e = scale + bend r + warm (T - 20) and r = |p - p_0|. The cause is not an
/// error of the arm, so it does not act on requests. A pure scale equals an arm that is longer in
/// all lengths and stands elsewhere. Only known lengths determine it: link geometry that is not
/// among the error sources. Bend and temperature have no such imitator.
class InstrumentScale final : public ErrorSource {
 public:
  explicit InstrumentScale(const Vector3& p_W) : p_W_(p_W) {}
  const CauseRecord& cause() const override { return causes::instrument_scale(); }
  std::string name() const override { return "instrument_scale"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the instrument tells distances too long, or too short";
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (context.served) return;
    const ArmKinematics kinematics(state);
    const Vector3 away = kinematics.tool_pose_W().translation() - p_W_;
    const double distance = away.norm();
    const Vector3 shares(1, distance,
                         context.temperature ? *context.temperature - kReferenceTemperature : 0);
    const double share = shares.dot(values.head<3>());
    state.tip_W.head<3>() += share * away;
    if (jacobian == nullptr) return;
    const StateRows& rows = jacobian->rows;
    Matrix3 by_place = share * Matrix3::Identity();
    if (distance > 0) by_place += values(1) / distance * away * away.transpose();
    jacobian->pass_on({rows.tip(0), rows.tip(1), rows.tip(2)},
                      by_place * kinematics.pose_jacobian().topRows<3>());
    jacobian->add_block(rows.tip(0), first_column, away * shares.transpose());
  }

 private:
  Vector3 p_W_;  // of the instrument
  const std::vector<Parameter> parameters_ = {{"scale", "um/m", kPartsPerMillion, 0, 5e-6},
                                              {"bend", "um/m/m", kPartsPerMillion, 0, 2e-6},
                                              {"warm", "um/m/K", kPartsPerMillion, 0, 2e-6}};
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell& cell) {
  return std::make_shared<InstrumentScale>(cell.tracker.p_W.value_or(Vector3::Zero()));
}

}  // namespace

const CauseRecord& causes::instrument_scale() {
  static const CauseRecord record = {
      .spelling = "instrument_scale",
      .plain_name = "scale of the instrument",
      .plain_name_of_joint = "",
      .scope = Scope::kSession,
      .lasting = Lasting::kOfTheSession,
      .needs = {.stand = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoadedArm, 9},
      .forms = {{"instrument_scale", make}},
      .rivals = {{.cause = "geometry"}, {.cause = "thermal_growth"}, {.cause = "tracker_drift"}},
      .told_apart_by = remedies::kReflectors,
      .shown_by =
          "a known length, measured near and far from the instrument, and where it stands "
          "(tracker: xyz_mm)",
      .action =
          "let the instrument be checked against a scale bar, and give it the air's temperature "
          "and pressure",
      .figures = {{"scale", "um/m", "how much too long it tells a distance"},
                  {"bend", "um/m/m", "how much more of that for each metre of distance"},
                  {"warm", "um/m/K", "how much more of that for each degree above 20"}},
  };
  return record;
}

}  // namespace trammel
