#include <utility>
#include <vector>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr int kMaxEquilibriumSteps = 50;
constexpr double kEquilibriumStep = 1e-13;  // rad

/// Every gearbox deflects in proportion to the gravity torque on it, and bars pass the deflection
/// on to coupled joints. A weight acts at its centre of gravity (the physical wrench). Eq. (3.6),
/// dx = J C Jᵀ F, has three forms. They differ by the square of the deflection: 50 um at a
/// deflection of 6 mrad.
class Compliance : public ErrorSource {
 public:
  explicit Compliance(const Chain& chain) {
    for (int i = 0; i < chain.size(); ++i) {
      parameters_.push_back(
          compliance_parameter(fmt::format("C{}", i + 1), chain.joint(i).compliance_prior));
    }
  }

  const CauseRecord& cause() const override { return causes::compliance(); }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the gearboxes give way under the weight of the payload";
  }

 protected:
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;

  /// State rows of all joints.
  static std::vector<int> joint_rows(const Chain& chain) {
    const StateRows rows(chain.size());
    std::vector<int> all;
    for (int j = 0; j < chain.size(); ++j) all.push_back(rows.of_joint(chain, j));
    return all;
  }

  /// Records how the joints move with each compliance: a row of `by_C` for each of `rows`.
  static void add_by_C(const Square& by_C, const std::vector<int>& rows, int first_column,
                       StateJacobian& jacobian) {
    for (Eigen::Index j = 0; j < by_C.cols(); ++j) {
      for (Eigen::Index i = 0; i < by_C.rows(); ++i) {
        const auto row = rows[static_cast<std::size_t>(i)];
        if (by_C(i, j) != 0) jacobian.add(row, first_column + static_cast<int>(j), by_C(i, j));
      }
    }
  }

  static void deflect(ArmState& state, const JointArray& of_gears) {
    const JointArray deflection = state.chain->bars() * of_gears;
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

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const ArmKinematics kinematics(state);
    const JointArray torque = kinematics.gravity_torque();
    if (jacobian != nullptr) {
      const std::vector<int> rows = joint_rows(*state.chain);
      const Square bars = state.chain->bars();
      if (!C.isZero(0))
        jacobian->pass_on(rows, bars * C.asDiagonal() * kinematics.gravity_torque_jacobian());
      add_by_C(bars * torque.asDiagonal(), rows, first_column, *jacobian);
    }
    deflect(state, C.cwiseProduct(torque));
  }
};

/// dq = C tau(q + dq): the posture in which springs and weight are in balance.
class ComplianceEquilibrium final : public Compliance {
 public:
  using Compliance::Compliance;
  std::string name() const override { return "compliance_equilibrium"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
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
    // The deflection of the gears obeys dg = C tau + C T (dq + ds), where dq = B dg. Hence (I - C
    // T_q B) dg = tau dC + C T_s ds. T is the torque's derivative in the loaded posture, and B are
    // the bars.
    const ArmKinematics loaded(state);
    const JointArray torque = loaded.gravity_torque();
    const JointStateMatrix T = loaded.gravity_torque_jacobian();
    const int n = state.chain->size();
    const std::vector<int> rows = joint_rows(*state.chain);
    Square by_joints(n, n);
    for (int j = 0; j < n; ++j)
      by_joints.col(j) = C.cwiseProduct(T.col(rows[static_cast<std::size_t>(j)]));
    const Square bars = state.chain->bars();
    const Square balance = Square::Identity(n, n) - by_joints * bars;
    const Square inverse = bars * balance.partialPivLu().inverse();
    jacobian->pass_on(rows, inverse * C.asDiagonal() * T);
    add_by_C(inverse * torque.asDiagonal(), rows, first_column, *jacobian);
  }
};

/// dx = J C Jᵀ F literally: added to the pose of the tool; joints and links do not move.
class ComplianceLinear final : public Compliance {
 public:
  using Compliance::Compliance;
  std::string name() const override { return "compliance_linear"; }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& C, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const ArmKinematics kinematics(state);
    const JointArray torque = kinematics.gravity_torque();
    const ArmKinematics::JointJacobian J = kinematics.deflection_jacobian();
    const JointArray deflection = C.cwiseProduct(torque);
    if (jacobian != nullptr) {
      const ArmKinematics::JointJacobian by_torque = J * C.asDiagonal();
      const JointStateMatrix T = kinematics.gravity_torque_jacobian();
      Eigen::MatrixXd by_state = kinematics.deflection_jacobian_derivative(deflection);
      for (int row = 0; row < T.cols(); ++row)
        by_state.col(row) += by_torque.lazyProduct(T.col(row));
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

bool carries_anything(const Cell& cell) {
  return !cell.payloads.empty() || cell.robot.has_link_masses();
}

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
      .rivals = {{.cause = "payload"},
                 {.cause = "link_bending"},
                 {.cause = "encoder_eccentricity"}},
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
