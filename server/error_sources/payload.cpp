#include <utility>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kMassPrior = 5;  // kg

void add_four(std::vector<Parameter>& parameters, const std::string& suffix) {
  parameters.push_back({"mass" + suffix, "kg", 1, 0, kMassPrior});
  for (const char* name : {"cx", "cy", "cz"})
    parameters.push_back(length_parameter(name + suffix, 20));
}

void load(const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state, StateJacobian* jacobian,
          int first_column) {
  state.payload.mass += values(0);
  state.payload.p_FoCog_F += values.segment<3>(1);
  if (jacobian == nullptr) return;
  jacobian->add(jacobian->rows.mass(), first_column, 1);
  for (int k = 0; k < 3; ++k) jacobian->add(jacobian->rows.cog(k), first_column + 1 + k, 1);
}

/// The mass or the centre of gravity of a payload differs from the cell file. Four parameters for
/// each payload of the cell. It shows only through compliance and bending. With a single payload,
/// its mass scales all compliances alike.
class PayloadError final : public ErrorSource {
 public:
  explicit PayloadError(const Cell& cell) {
    for (const auto& [id, payload] : cell.payloads) {
      ids_.push_back(id);
      add_four(parameters_, cell.payloads.size() > 1 ? "[" + id + "]" : "");
    }
  }
  const CauseRecord& cause() const override { return causes::payload(); }
  std::string name() const override { return "payload"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the payload's mass or centre of gravity is not as the cell file says";
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    for (std::size_t k = 0; k < ids_.size(); ++k) {
      const int first = 4 * static_cast<int>(k);
      if (ids_[k] == context.payload)
        load(values.segment<4>(first), state, jacobian, first_column + first);
    }
  }

 private:
  std::vector<std::string> ids_;
  std::vector<Parameter> parameters_;
};

/// From a pose on, another load hangs on the flange.
class PayloadChanged final : public ErrorSource {
 public:
  explicit PayloadChanged(const SourceSpec& spec)
      : name_(spec.text), first_(static_cast<int>(spec.at[0]) - 1) {
    add_four(parameters_, fmt::format("@{}", first_ + 1));
  }
  const CauseRecord& cause() const override { return causes::payload_changed(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("the payload changed before pose {}", first_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (context.from(first_)) load(values, state, jacobian, first_column);
  }

 private:
  std::string name_;
  int first_;
  std::vector<Parameter> parameters_;
};

std::vector<causes::Figure> load_figures() {
  return {{"mass", "kg", "how much heavier"},
          {"cx", "mm", "centre of gravity along x of the flange"},
          {"cy", "mm", "along y"},
          {"cz", "mm", "along z"}};
}

Result<ErrorSourcePtr> make_payload(const SourceSpec& spec, const Cell& cell) {
  if (cell.payloads.empty())
    return refused("error source '{}': cell {} has no payload", spec.text, cell.name);
  return std::make_shared<PayloadError>(cell);
}
Result<ErrorSourcePtr> make_payload_changed(const SourceSpec& spec, const Cell& cell) {
  if (cell.payloads.empty())
    return refused("error source '{}': cell {} has no payload", spec.text, cell.name);
  return std::make_shared<PayloadChanged>(spec);
}

}  // namespace

const CauseRecord& causes::payload() {
  static const CauseRecord record = {
      .spelling = "payload",
      .plain_name = "payload mass or centre of gravity",
      .plain_name_of_joint = "",
      .scope = Scope::kCell,
      .lasting = Lasting::kAlways,
      .needs = {.payload = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoad, 0},
      .forms = {{"payload", make_payload}},
      .rivals = {{.cause = "compliance"}, {.cause = "link_bending"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = remedies::kOtherLoad.text,
      .action = "weigh the payload and correct the cell file",
      .figures = load_figures(),
      .part = Part::kPayload,
      .numbers = Numbers::kSingly,
  };
  return record;
}

const CauseRecord& causes::payload_changed() {
  static const CauseRecord record = {
      .spelling = "payload_changed",
      .plain_name = "the payload changed",
      .plain_name_of_joint = "",
      .scope = Scope::kCell,
      .lasting = Lasting::kFromAPose,
      .needs = {.payload = true},
      .search = SearchFamily::kStep,
      .acts = {ActsOn::kLoad, 1},
      .forms = {{"payload_changed", make_payload_changed}},
      .rivals = {{.cause = "payload", .likeness = Likeness::kFromTheFirstPose},
                 {.cause = "tool_changed"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = "a payload_id for every pose, wide poses before and after",
      .action =
          "find out what was mounted or lost at that pose, and give the poses their payload_id",
      .figures = load_figures(),
      .whole_batch = WholeBatch{"the payload is another one", true},
  };
  return record;
}

}  // namespace trammel
