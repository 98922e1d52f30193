#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

/// The link parameters differ from the nominal ones: q, d (or beta in a Hayati row), a and alpha of
/// every link, eqs. (3.3) and (3.4), 24 parameters for a six-axis arm with one pair of parallel
/// axes.
class Geometry final : public ErrorSource {
 public:
  explicit Geometry(const Chain& chain) {
    for (int i = 0; i < chain.size(); ++i) {
      const auto add = [&](double LinkGeometry::*member, int row, const char* symbol, bool length) {
        const std::string name = fmt::format("{}{}", symbol, i + 1);
        entries_.push_back({i, member, row});
        parameters_.push_back(length ? length_parameter(name, 2) : angle_parameter(name, 5e-3));
      };
      const StateRows rows(chain.size());
      const bool prismatic = chain.joint(i).type == JointType::kPrismatic;
      add(&LinkGeometry::theta, rows.theta(i), prismatic ? "theta" : "q", false);
      if (!chain.joint(i).hayati) add(&LinkGeometry::d, rows.d(i), "d", true);
      add(&LinkGeometry::a, rows.a(i), "a", true);
      add(&LinkGeometry::alpha, rows.alpha(i), "alpha", false);
      if (chain.joint(i).hayati) add(&LinkGeometry::beta, rows.beta(i), "beta", false);
    }
  }

  const CauseRecord& cause() const override { return causes::geometry(); }
  std::string name() const override { return "geometry"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "link lengths, twists and joint zeros differ from the drawing";
  }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    for (std::size_t k = 0; k < entries_.size(); ++k) {
      const Entry& entry = entries_[k];
      const double value = values(static_cast<Eigen::Index>(k));
      const int column = first_column + static_cast<int>(k);
      if (entry.row == StateRows(state.chain->size()).of_joint(*state.chain, entry.link)) {
        add_to_zero(entry.link, value, state, jacobian, column);
      } else {
        state.links[static_cast<std::size_t>(entry.link)].*entry.member += value;
        if (jacobian != nullptr) jacobian->add(entry.row, column, 1);
      }
    }
  }

 private:
  /// Adds to a joint's zero. The zero belongs to the gear and is counted as the axis turns, so
  /// joints that bars couple move as well.
  static void add_to_zero(int joint, double value, ArmState& state, StateJacobian* jacobian,
                          int column) {
    const double sign = state.chain->joint(joint).sign;
    state.add_to_joint(joint, sign * value);
    if (jacobian != nullptr) jacobian->add_to_joint(joint, column, sign);
  }

  struct Entry {
    int link;
    double LinkGeometry::*member;
    int row;
  };
  std::vector<Entry> entries_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec&, const Cell& cell) {
  return std::make_shared<Geometry>(cell.robot);
}

}  // namespace

const CauseRecord& causes::geometry() {
  static const CauseRecord record = {
      .spelling = "geometry",
      .plain_name = "link geometry",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLinks, 0},
      .forms = {{"geometry", make}},
      .rivals = {{.cause = "base"}, {.cause = "tool"}, {.cause = "joint_map"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "a wider range of joints",
      .action = "identify the geometry",
      .figures = {{"q", "rad", "zero of a joint"},
                  {"theta", "rad", "angle of a link on a rail"},
                  {"d", "mm", "offset of a link along its axis"},
                  {"a", "mm", "length of a link"},
                  {"alpha", "rad", "twist of a link"},
                  {"beta", "rad", "tilt of a link beside a parallel one"}},
      .part = Part::kLinks,
      .numbers = Numbers::kApart,
  };
  return record;
}

}  // namespace trammel
