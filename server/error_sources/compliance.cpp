#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// Every gearbox gives way in proportion to the torque that the payload's weight puts on it: dq = C Jᵀ F at the
/// commanded posture, eq. (3.6), applied through the joints. The weight acts at the payload's centre of gravity.
class Compliance final : public ErrorSource {
 public:
  explicit Compliance(const Chain& chain) {
    for (int i = 0; i < chain.size(); ++i) {
      parameters_.push_back(compliance_parameter(fmt::format("C{}", i + 1), chain.joint(i).compliance_prior));
    }
  }

  std::string name() const override { return "compliance"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the gearboxes give way under the weight of the payload"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const ArmKinematics kinematics(state);
    const Eigen::VectorXd torque = kinematics.gravity_torque();
    if (jacobian != nullptr) {
      const Eigen::MatrixXd torque_by_parameter =
          kinematics.gravity_torque_jacobian() * jacobian->matrix.leftCols(first_column);
      for (int j = 0; j < state.chain->size(); ++j) {
        const int row = deflected_row(*state.chain, jacobian->rows, j);
        jacobian->matrix.row(row).head(first_column) += values(j) * torque_by_parameter.row(j);
        jacobian->matrix(row, first_column + j) = torque(j);
      }
    }
    for (int j = 0; j < state.chain->size(); ++j) {
      LinkGeometry& link = state.links[static_cast<std::size_t>(j)];
      (state.chain->joint(j).type == JointType::kRevolute ? link.theta : link.d) += values(j) * torque(j);
    }
  }

 private:
  static int deflected_row(const Chain& chain, const StateRows& rows, int joint) {
    return chain.joint(joint).type == JointType::kRevolute ? rows.theta(joint) : rows.d(joint);
  }

  std::vector<Parameter> parameters_;
};

}  // namespace

Result<ErrorSourcePtr> make_compliance(const Cell& cell, int) { return std::make_shared<Compliance>(cell.robot); }

}  // namespace trammel
