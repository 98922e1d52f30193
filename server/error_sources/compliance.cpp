#include <utility>
#include <vector>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

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

  const CauseRecord& cause() const override { return causes::compliance(); }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the gearboxes give way under the weight of the payload"; }

 protected:
  /// State rows of all joints.
  static std::vector<int> joint_rows(const Chain& chain) {
    const StateRows rows(chain.size());
    std::vector<int> all;
    for (int j = 0; j < chain.size(); ++j) all.push_back(rows.of_joint(chain, j));
    return all;
  }

  static void deflect(ArmState& state, const JointArray& deflection) {
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
    const JointArray torque = kinematics.gravity_torque();
    if (jacobian != nullptr) {
      const std::vector<int> rows = joint_rows(*state.chain);
      jacobian->pass_on(rows, C.asDiagonal() * kinematics.gravity_torque_jacobian());
      for (int j = 0; j < state.chain->size(); ++j) {
        jacobian->add(rows[static_cast<std::size_t>(j)], first_column + j, torque(j));
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
    JointArray deflection = JointArray::Zero(C.size());
    for (int step = 0; step < kMaxEquilibriumSteps; ++step) {
      const JointArray next = C.cwiseProduct(ArmKinematics(state).gravity_torque());
      const double moved = (next - deflection).cwiseAbs().maxCoeff();
      deflection = next;
      state = unloaded;
      deflect(state, deflection);
      if (moved < kEquilibriumStep) break;
    }
    if (jacobian == nullptr) return;
    // dq = C tau + C T (dq + ds): (I - C T_q) dq = tau dC + C T_s ds, T the torque's derivative in the loaded posture.
    const ArmKinematics loaded(state);
    const JointArray torque = loaded.gravity_torque();
    const JointStateMatrix T = loaded.gravity_torque_jacobian();
    const int n = state.chain->size();
    const std::vector<int> rows = joint_rows(*state.chain);
    using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;
    Square balance = Square::Identity(n, n);
    for (int j = 0; j < n; ++j) balance.col(j) -= C.cwiseProduct(T.col(rows[static_cast<std::size_t>(j)]));
    const Square inverse = balance.partialPivLu().inverse();
    jacobian->pass_on(rows, inverse * C.asDiagonal() * T);
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        jacobian->add(rows[static_cast<std::size_t>(i)], first_column + j, inverse(i, j) * torque(j));
      }
    }
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
    const JointArray torque = kinematics.gravity_torque();
    const ArmKinematics::DeflectionJacobian J = kinematics.deflection_jacobian();
    const JointArray deflection = C.cwiseProduct(torque);
    if (jacobian != nullptr) {
      const ArmKinematics::DeflectionJacobian by_torque = J * C.asDiagonal();
      const JointStateMatrix T = kinematics.gravity_torque_jacobian();
      Eigen::MatrixXd by_state = kinematics.deflection_jacobian_derivative(deflection);
      for (int row = 0; row < T.cols(); ++row) by_state.col(row) += by_torque.lazyProduct(T.col(row));
      jacobian->pass_on(jacobian->rows.whole_tip(), std::move(by_state));
      jacobian->add_block(jacobian->rows.tip(0), first_column, J * torque.asDiagonal());
    }
    state.tip_W += J * deflection;
  }
};

template <typename ComplianceForm>
Result<ErrorSourcePtr> make(const SourceSpec&, const Cell& cell) {
  return std::make_shared<ComplianceForm>(cell.robot);
}

bool carries_anything(const Cell& cell) { return !cell.payloads.empty() || cell.robot.has_link_masses(); }

}  // namespace

const CauseRecord& causes::compliance() {
  static const CauseRecord record = {
      .spelling = "compliance",
      .plain_name = "gearbox compliance",
      .plain_name_of_joint = "gearbox compliance in joint {}",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoadedArm, 2},
      .forms = {{"compliance_first_order", make<ComplianceFirstOrder>},
                {"compliance_equilibrium", make<ComplianceEquilibrium>},
                {"compliance_linear", make<ComplianceLinear>}},
      .rivals = {{.cause = "payload"}, {.cause = "link_bending"}, {.cause = "encoder_eccentricity"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = remedies::kOtherLoad.text,
      .action = "compensate it for this payload",
      .figures = {{"C", "rad/Nmm", "how far a gearbox gives way"}},
      .numbers = Numbers::kOneAJoint,
      .gives_way = true,
      .forms_differ = carries_anything,
  };
  return record;
}

}  // namespace trammel
