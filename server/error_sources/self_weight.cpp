#include <cmath>

#include "server/error_sources/expected_weights.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kLessExpected = 8;     // nat, while the arm's geometry is not in the model
constexpr double kVertical = 1 - 1e-6;  // cosine: an axis along gravity feels no weight

/// True where the weight beyond joint `i` can turn a joint at all. It cannot if all axes up to it
/// lie on one vertical line.
bool is_felt(const Cell& cell, int i) {
  const Chain& chain = cell.robot;
  if (chain.joint(i).type != JointType::kRevolute) return false;
  for (int j = 0; j < i; ++j)
    if (chain.joint(j).type == JointType::kRevolute) return true;
  if (!cell.X_WB) return true;
  ArmState arm;
  arm.chain = &chain;
  arm.links = chain.links_at(JointVector::Zero(chain.size()));
  arm.X_WB = *cell.X_WB;
  const Vector3 axis = ArmKinematics(arm).axis_jacobian().col(i).tail<3>();
  return std::abs(axis.dot(cell.gravity_W)) < kVertical;
}

/// The weight of the links, without a data sheet. Joint j feels the torque z_j . (sum over i >= j
/// of b_i) x g, where b_i is the first moment of everything that link i carries as one piece. The
/// part of b_i along its own axis belongs to the link before. So each link keeps two numbers, which
/// are all that torques show. The poses show torques through compliances only.
class LinkWeights final : public ErrorSource {
 public:
  explicit LinkWeights(const Cell& cell) {
    const ExpectedWeights expected = expected_weights(cell.robot);
    for (int i = 0; i < cell.robot.size(); ++i) {
      if (!is_felt(cell, i)) continue;
      links_.push_back(i);
      for (int k = 0; k < 2; ++k) {
        parameters_.push_back({fmt::format("{}{}", k == 0 ? "wx" : "wy", i + 1), "kg m", 1,
                               expected.moment(k, i), expected.spread(i)});
      }
    }
  }
  const CauseRecord& cause() const override { return causes::self_weight(); }
  std::string name() const override { return "self_weight"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the links' own weights load the gearboxes, by what the poses show of them";
  }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (state.first_moments.cols() == 0)
      state.first_moments = FirstMoments::Zero(2, state.chain->size());
    for (std::size_t l = 0; l < links_.size(); ++l) {
      const int column = 2 * static_cast<int>(l);
      state.first_moments.col(links_[l]) += values.segment<2>(column);
      if (jacobian == nullptr) continue;
      for (int k = 0; k < 2; ++k)
        jacobian->add(jacobian->rows.first_moment(links_[l], k), first_column + column + k, 1);
    }
  }

 private:
  std::vector<int> links_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell& cell) {
  return std::make_shared<LinkWeights>(cell);
}

}  // namespace

const CauseRecord& causes::self_weight() {
  static const CauseRecord record = {
      .spelling = "self_weight",
      .plain_name = "link weights",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoad, 2},
      .forms = {{"self_weight", make}},
      .rivals = {{.cause = "compliance"},
                 {.cause = "geometry", .surprise = kLessExpected},
                 {.cause = "encoder_eccentricity"},
                 {.cause = "payload", .likeness = Likeness::kSimplerCase}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = remedies::kOtherLoad.text,
      .action = "keep it in the cell's error sources, or give the links' masses in the robot file",
      .figures = {{"wx", "kg m", "first moment of all that a link carries, along the link"},
                  {"wy", "kg m", "across link and axis"}},
      .added_by_data =
          AddedByData{
              .beside = "compliance",
              .is_known = [](const Cell& cell) { return cell.robot.has_link_masses(); },
              .note = "the robot file tells no link masses, and these poses show the links' "
                      "weight: gearbox compliance acts on link weights that were found from the "
                      "poses (self_weight); without them it would act on the payload alone"},
  };
  return record;
}

}  // namespace trammel
