#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

/// The base is not at its nominal pose: X_WB = X_WB_nominal Tx Ty Tz Rz(gamma0) Ry(beta0)
/// Rx(alpha0), eq. (3.5). Calibration centres the prior on the localised base, because the base is
/// measured and not known from drawings.
class Base final : public ErrorSource {
 public:
  const CauseRecord& cause() const override { return causes::base(); }
  std::string name() const override { return "base"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the robot base stands elsewhere than the cell file says";
  }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const Pose X_WB_nominal = state.X_WB;
    state.X_WB = X_WB_nominal * pose_zyx(values.head<3>(), values(3), values(4), values(5));
    if (jacobian == nullptr) return;
    const Matrix3 R = X_WB_nominal.linear();
    const Matrix3 Rz = Eigen::AngleAxisd(values(3), Vector3::UnitZ()).toRotationMatrix();
    const Matrix3 RzRy = Rz * Eigen::AngleAxisd(values(4), Vector3::UnitY()).toRotationMatrix();
    const int translation = jacobian->rows.base(0);
    const int rotation = jacobian->rows.base(3);
    jacobian->add_block(translation, first_column, R);
    jacobian->add_block(rotation, first_column + 3, R.col(2));
    jacobian->add_block(rotation, first_column + 4, R * Rz.col(1));
    jacobian->add_block(rotation, first_column + 5, R * RzRy.col(0));
  }

 private:
  const std::vector<Parameter> parameters_ = {
      length_parameter("x0", 2),      length_parameter("y0", 2),
      length_parameter("z0", 2),      angle_parameter("gamma0", 5e-3),
      angle_parameter("beta0", 5e-3), angle_parameter("alpha0", 5e-3)};
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell&) { return std::make_shared<Base>(); }

}  // namespace

const CauseRecord& causes::base() {
  static const CauseRecord record = {
      .spelling = "base",
      .plain_name = "base position",
      .plain_name_of_joint = "",
      .scope = Scope::kCell,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kBase, 0},
      .forms = {{"base", make}},
      .rivals = {{.cause = "tracker_moved"}, {.cause = "geometry", .parameter = "q1"}},
      .told_apart_by = remedies::kFixedBase,
      .shown_by = remedies::kFixedBase.text,
      .action = "localise the base",
      .figures = {{"x0", "mm", "base along x"},
                  {"y0", "mm", "base along y"},
                  {"z0", "mm", "base along z"},
                  {"gamma0", "rad", "base about z"},
                  {"beta0", "rad", "base about y"},
                  {"alpha0", "rad", "base about x"}},
      .part = Part::kBase,
  };
  return record;
}

}  // namespace trammel
