#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "server/error_sources/frame_motion.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kMostRows = 1e6;  // of a batch

void add_six(std::vector<Parameter>& parameters, const std::string& suffix) {
  for (const char* name : {"tx", "ty", "tz"})
    parameters.push_back(length_parameter(name + suffix, 2));
  for (const char* name : {"trz", "try", "trx"})
    parameters.push_back(angle_parameter(name + suffix, 5e-3));
}

/// The pose of a tool on the flange differs from the nominal one: X_FT = Tx Ty Tz Rz Ry Rx
/// X_FT_nominal, in F; six parameters for each tool of the cell. With one tool it can be separated
/// from the last link only in part: tx = a6, tz = d6, trx = alpha6, trz = q6.
class Tool final : public ErrorSource {
 public:
  explicit Tool(const Cell& cell) {
    for (const auto& [id, X_FT] : cell.tools) {
      ids_.push_back(id);
      add_six(parameters_, cell.tools.size() > 1 ? "[" + id + "]" : "");
    }
  }
  const CauseRecord& cause() const override { return causes::tool(); }
  std::string name() const override { return "tool"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return "the tool sits on the flange elsewhere than the cell file says";
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    for (std::size_t k = 0; k < ids_.size(); ++k) {
      const int first = 6 * static_cast<int>(k);
      if (ids_[k] == context.tool)
        move_tool(values.segment<6>(first), state, jacobian, first_column + first);
    }
  }

 private:
  std::vector<std::string> ids_;
  std::vector<Parameter> parameters_;
};

/// From a pose on, a tool sits elsewhere on the flange, because it was changed or knocked. `tool`
/// is its name; empty: any tool. With a third number the change ends at that pose, when the tool,
/// or the reflector on it, was put back; then it does not act on requests.
class ToolChanged final : public ErrorSource {
 public:
  ToolChanged(const SourceSpec& spec, std::string tool)
      : name_(spec.text), first_(static_cast<int>(spec.at[0]) - 1), tool_(std::move(tool)) {
    if (spec.at.size() > 2) back_ = static_cast<int>(spec.at[2]);
    add_six(parameters_, fmt::format("@{}{}{}", first_ + 1, back_ ? fmt::format("-{}", *back_) : "",
                                     tool_.empty() ? "" : "[" + tool_ + "]"));
  }
  const CauseRecord& cause() const override { return causes::tool_changed(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    const std::string tool = tool_.empty() ? "" : " " + tool_;
    if (back_)
      return fmt::format("the tool{}, or the reflector on it, sat elsewhere from pose {} to {}",
                         tool, first_ + 1, *back_);
    return fmt::format("the tool{} was changed or knocked before pose {}", tool, first_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const bool is_there = context.from(first_) && !(back_ && context.from(*back_));
    if (is_there && (tool_.empty() || context.tool == tool_))
      move_tool(values, state, jacobian, first_column);
  }

 private:
  std::string name_;
  int first_;
  std::optional<int> back_;  // index of the first pose where it sits as before
  std::string tool_;
  std::vector<Parameter> parameters_;
};

std::vector<causes::Figure> tool_figures() {
  return {{"tx", "mm", "tool along x of the flange"},
          {"ty", "mm", "tool along y"},
          {"tz", "mm", "tool along z"},
          {"trz", "rad", "tool about z of the flange"},
          {"try", "rad", "tool about y"},
          {"trx", "rad", "tool about x"}};
}

Result<ErrorSourcePtr> make_tool(const SourceSpec&, const Cell& cell) {
  return std::make_shared<Tool>(cell);
}
Result<ErrorSourcePtr> make_tool_changed(const SourceSpec& spec, const Cell& cell) {
  if (spec.at.size() < 2) return std::make_shared<ToolChanged>(spec, "");
  if (spec.at[1] != std::floor(spec.at[1]) || spec.at[1] > static_cast<double>(cell.tools.size()))
    return failure(ErrorCode::kUsage,
                   "error source '{}': tool {:g} of {}, in the order of their names", spec.text,
                   spec.at[1], cell.tools.size());
  if (spec.at.size() > 2 &&
      (spec.at[2] != std::floor(spec.at[2]) || spec.at[2] < spec.at[0] || spec.at[2] > kMostRows))
    return failure(ErrorCode::kUsage, "error source '{}': {:g} is no pose from {:g} on", spec.text,
                   spec.at[2], spec.at[0]);
  return std::make_shared<ToolChanged>(
      spec, std::next(cell.tools.begin(), static_cast<int>(spec.at[1]) - 1)->first);
}

}  // namespace

const CauseRecord& causes::tool() {
  static const CauseRecord record = {
      .spelling = "tool",
      .plain_name = "tool position",
      .plain_name_of_joint = "",
      .scope = Scope::kCell,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kTool, 0},
      .forms = {{"tool", make_tool}},
      .rivals = {{.cause = "geometry", .parameter = "d6"},
                 {.cause = "geometry", .parameter = "a6"}},
      .told_apart_by = remedies::kOtherTool,
      .shown_by = remedies::kOtherTool.text,
      .action = "measure the tool again and correct the cell file",
      .figures = tool_figures(),
      .part = Part::kTool,
  };
  return record;
}

const CauseRecord& causes::tool_changed() {
  static const CauseRecord record = {
      .spelling = "tool_changed",
      .plain_name = "the tool was changed or knocked",
      .plain_name_of_joint = "",
      .scope = Scope::kCell,
      .lasting = Lasting::kFromAPose,
      .needs = {},
      .search = SearchFamily::kStep,
      .acts = {ActsOn::kTool, 1},
      .forms = {{"tool_changed", make_tool_changed}},
      .rivals = {{.cause = "tool", .likeness = Likeness::kFromTheFirstPose},
                 {.cause = "joint_slip"}},
      .told_apart_by = remedies::kOtherTool,
      .shown_by = "a second tool, or reference reflectors on the flange",
      .action = "find out what knocked or changed the tool at that pose; measure again after it",
      .figures = tool_figures(),
      .takes_numbers = true,
      .whole_batch = WholeBatch{"the tool is another one, or sits elsewhere on the flange", true},
  };
  return record;
}

}  // namespace trammel
