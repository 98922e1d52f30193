#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// The tool sits on the flange elsewhere than believed: X_FT = Tx Ty Tz Rz Ry Rx X_FT_nominal, all in F. With one tool
/// it is told from the last link only in part: tx = a6, tz = d6, trx = alpha6, trz = q6.
class Tool final : public ErrorSource {
 public:
  std::string name() const override { return "tool"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the tool sits on the flange elsewhere than the cell file says"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const Vector3 t = values.head<3>();
    state.X_FT = pose_zyx(t, values(3), values(4), values(5)) * state.X_FT;
    if (jacobian == nullptr) return;
    const Matrix3 Rz = Eigen::AngleAxisd(values(3), Vector3::UnitZ()).toRotationMatrix();
    const Matrix3 RzRy = Rz * Eigen::AngleAxisd(values(4), Vector3::UnitY()).toRotationMatrix();
    Matrix3 axes;
    axes << Vector3::UnitZ(), Rz.col(1), RzRy.col(0);
    const int translation = jacobian->rows.tool(0);
    const int rotation = jacobian->rows.tool(3);
    jacobian->matrix.block<3, 3>(translation, first_column).setIdentity();
    jacobian->matrix.block<3, 3>(rotation, first_column + 3) = axes;
    // These axes go through t, the rows through the origin of F.
    jacobian->matrix.block<3, 3>(translation, first_column + 3) = skew(t) * axes;
  }

 private:
  const std::vector<Parameter> parameters_ = {length_parameter("tx", 2),    length_parameter("ty", 2),
                                              length_parameter("tz", 2),    angle_parameter("trz", 5e-3),
                                              angle_parameter("try", 5e-3), angle_parameter("trx", 5e-3)};
};

}  // namespace

Result<ErrorSourcePtr> make_tool(const Cell&, int) { return std::make_shared<Tool>(); }

}  // namespace trammel
