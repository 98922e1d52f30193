#include "server/error_sources/expected_weights.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kTilt = 1e-9;  // rad/Nmm: prior; a robot on a steel plate

/// Pedestal and anchors deflect: B turns about its own x and y axes, at its origin, in proportion
/// to the moment of all weights about that origin. A weight that does not turn with the first joint
/// belongs to the base's position. A weight that turns with the first joint as one piece loads no
/// gearbox. It shows here if the foot's compliance differs between the two axes.
class BaseYielding final : public ErrorSource {
 public:
  explicit BaseYielding(const Chain& chain) {
    while (turning_ + 1 < chain.size() && chain.joint(turning_).type != JointType::kRevolute)
      ++turning_;
    const ExpectedWeights expected = expected_weights(chain);
    for (const char* name : {"Cbx0", "Cby0"}) {
      parameters_.push_back(compliance_parameter(name, 0));
      parameters_.back().prior_scale = from_rad_per_nmm(kTilt);
    }
    for (int k = 0; k < 2; ++k) {
      parameters_.push_back({k == 0 ? "wx0" : "wy0", "kg m", 1, expected.moment(k, turning_),
                             expected.spread(turning_)});
    }
  }
  const CauseRecord& cause() const override { return causes::base_compliance(); }
  std::string name() const override { return "base_compliance"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the base tilts under the moment of arm and payload";
  }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (state.first_moments.cols() == 0)
      state.first_moments = FirstMoments::Zero(2, state.chain->size());
    state.first_moments.col(turning_) += values.segment<2>(2);
    for (int k = 0; jacobian != nullptr && k < 2; ++k)
      jacobian->add(jacobian->rows.first_moment(turning_, k), first_column + 2 + k, 1);
    const ArmKinematics kinematics(state);
    const Vector3 moment = kinematics.base_moment();
    const Eigen::Matrix<double, 3, 2> axes = state.X_WB.linear().leftCols<2>();
    const Eigen::Vector2d about = axes.transpose() * moment;
    const Matrix3 yielding = axes * values.head<2>().asDiagonal() * axes.transpose();
    const Vector3 tilt = yielding * moment;
    const Matrix3 turn = rotation_exp(tilt);
    state.X_WB.linear() = (turn * state.X_WB.linear()).eval();
    if (jacobian == nullptr) return;
    const StateRows& rows = jacobian->rows;
    StateMatrix<3> by_state = yielding * kinematics.base_moment_jacobian();
    // An earlier rotation of B turns these axes, too.
    by_state.block<3, 3>(0, rows.base(3)) += yielding * skew(moment) - skew(tilt);
    const Matrix3 left = left_jacobian(tilt);
    jacobian->pass_on({rows.base(3), rows.base(4), rows.base(5)},
                      turn.transpose() * left * by_state);
    jacobian->transform(rows.base(3), turn);
    for (int k = 0; k < 2; ++k)
      jacobian->add_block(rows.base(3), first_column + k, left * axes.col(k) * about(k));
  }

 private:
  int turning_ = 0;  // the first joint that turns
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell& cell) {
  return std::make_shared<BaseYielding>(cell.robot);
}

}  // namespace

const CauseRecord& causes::base_compliance() {
  static const CauseRecord record = {
      .spelling = "base_compliance",
      .plain_name = "yielding of the base",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoadedArm, 4},
      .forms = {{"base_compliance", make}},
      .rivals = {{.cause = "compliance"}, {.cause = "base"}, {.cause = "link_bending"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = "poses all around the base, and a second known payload or a run without any",
      .action = "tighten the anchors or stiffen the pedestal, or compensate it",
      .figures =
          {{"Cbx", "rad/Nmm", "how far the base gives way about its x axis"},
           {"Cby", "rad/Nmm", "about its y axis"},
           {"wx", "kg m",
            "first moment of what turns with the first joint as one piece, along the first link"},
           {"wy", "kg m", "across it"}},
      .gives_way = true,
  };
  return record;
}

}  // namespace trammel
