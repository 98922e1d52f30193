#include <functional>

#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

constexpr int kMaxEquilibriumSteps = 50;
constexpr double kEquilibriumStep = 1e-13;  // rad

/// Every gearbox gives way in proportion to the torque that the payload's weight puts on it. The weight acts at the
/// payload's centre of gravity (the physical wrench). Three readings of eq. (3.6), dx = J C Jᵀ F, which differ by the
/// square of the deflection: 50 um where a joint gives way by 6 mrad.
class Compliance : public ErrorSource {
 public:
  explicit Compliance(const Chain& chain) {
    for (int i = 0; i < chain.size(); ++i) {
      parameters_.push_back(compliance_parameter(fmt::format("C{}", i + 1), chain.joint(i).compliance_prior));
    }
  }

  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the gearboxes give way under the weight of the payload"; }

 protected:
  static int row_of(const ArmState& state, const StateRows& rows, int joint) {
    return state.chain->joint(joint).type == JointType::kRevolute ? rows.theta(joint) : rows.d(joint);
  }

  static void deflect(ArmState& state, const Eigen::VectorXd& deflection) {
    for (int j = 0; j < state.chain->size(); ++j) {
      LinkGeometry& link = state.links[static_cast<std::size_t>(j)];
      (state.chain->joint(j).type == JointType::kRevolute ? link.theta : link.d) += deflection(j);
    }
  }

 private:
  std::vector<Parameter> parameters_;
};

/// dq = C tau, tau at the unloaded posture; the links then follow the deflected joints.
class ComplianceFirstOrder final : public Compliance {
 public:
  using Compliance::Compliance;
  std::string name() const override { return "compliance_first_order"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state, StateJacobian* jacobian,
             int first_column) const override {
    const ArmKinematics kinematics(state);
    const Eigen::VectorXd torque = kinematics.gravity_torque();
    if (jacobian != nullptr) {
      auto earlier = jacobian->matrix.leftCols(first_column);
      const Eigen::MatrixXd torque_change = kinematics.gravity_torque_jacobian() * earlier;
      for (int j = 0; j < state.chain->size(); ++j) {
        const int row = row_of(state, jacobian->rows, j);
        earlier.row(row) += C(j) * torque_change.row(j);
        jacobian->matrix(row, first_column + j) = torque(j);
      }
    }
    deflect(state, C.cwiseProduct(torque));
  }
};

/// dq = C tau(q + dq): the posture in which springs and weight are in balance.
class ComplianceEquilibrium final : public Compliance {
 public:
  using Compliance::Compliance;
  std::string name() const override { return "compliance_equilibrium"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state, StateJacobian* jacobian,
             int first_column) const override {
    const ArmState unloaded = state;
    Eigen::VectorXd deflection = Eigen::VectorXd::Zero(C.size());
    for (int step = 0; step < kMaxEquilibriumSteps; ++step) {
      const Eigen::VectorXd next = C.cwiseProduct(ArmKinematics(state).gravity_torque());
      const double moved = (next - deflection).cwiseAbs().maxCoeff();
      deflection = next;
      state = unloaded;
      deflect(state, deflection);
      if (moved < kEquilibriumStep) break;
    }
    if (jacobian == nullptr) return;
    // dq = C tau + C T (dq + ds): (I - C T_q) dq = tau dC + C T_s ds, T the torque's derivative in the loaded posture.
    const ArmKinematics loaded(state);
    const Eigen::VectorXd torque = loaded.gravity_torque();
    const Eigen::MatrixXd T = loaded.gravity_torque_jacobian();
    const int n = state.chain->size();
    Eigen::MatrixXd balance = Eigen::MatrixXd::Identity(n, n);
    for (int j = 0; j < n; ++j) balance.col(j) -= C.cwiseProduct(T.col(row_of(state, jacobian->rows, j)));
    auto earlier = jacobian->matrix.leftCols(first_column);
    Eigen::MatrixXd right(n, first_column + n);
    right << C.asDiagonal() * (T * earlier), Eigen::MatrixXd(torque.asDiagonal());
    const Eigen::MatrixXd change = balance.partialPivLu().solve(right);
    for (int j = 0; j < n; ++j)
      jacobian->matrix.row(row_of(state, jacobian->rows, j)).head(first_column + n) += change.row(j);
  }
};

/// dx = J C Jᵀ F to the letter: added to the tool's pose, joints and links where they were.
class ComplianceLinear final : public Compliance {
 public:
  using Compliance::Compliance;
  std::string name() const override { return "compliance_linear"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state, StateJacobian* jacobian,
             int first_column) const override {
    const ArmKinematics kinematics(state);
    const Eigen::VectorXd torque = kinematics.gravity_torque();
    const Eigen::MatrixXd J = kinematics.deflection_jacobian();
    const Eigen::VectorXd deflection = C.cwiseProduct(torque);
    if (jacobian != nullptr) {
      auto earlier = jacobian->matrix.leftCols(first_column);
      const int tip = jacobian->rows.tip(0);
      const Eigen::MatrixXd by_state = J * C.asDiagonal() * kinematics.gravity_torque_jacobian() +
                                       kinematics.deflection_jacobian_derivative(deflection);
      jacobian->matrix.block(tip, 0, 6, first_column) += (by_state * earlier).eval();
      jacobian->matrix.block(tip, first_column, 6, C.size()) = J * torque.asDiagonal();
    }
    state.tip_W += J * deflection;
  }
};

}  // namespace

Result<ErrorSourcePtr> make_compliance_first_order(const SourceSpec&, const Cell& cell) {
  return std::make_shared<ComplianceFirstOrder>(cell.robot);
}
Result<ErrorSourcePtr> make_compliance_equilibrium(const SourceSpec&, const Cell& cell) {
  return std::make_shared<ComplianceEquilibrium>(cell.robot);
}
Result<ErrorSourcePtr> make_compliance_linear(const SourceSpec&, const Cell& cell) {
  return std::make_shared<ComplianceLinear>(cell.robot);
}

}  // namespace trammel
