#include <iterator>
#include <utility>

#include "server/error_sources/frame_motion.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

void add_six(std::vector<Parameter>& parameters, const std::string& suffix) {
  for (const char* name : {"tx", "ty", "tz"}) parameters.push_back(length_parameter(name + suffix, 2));
  for (const char* name : {"trz", "try", "trx"}) parameters.push_back(angle_parameter(name + suffix, 5e-3));
}

/// A tool sits on the flange elsewhere than believed: X_FT = Tx Ty Tz Rz Ry Rx X_FT_nominal, in F; six parameters for
/// each tool of the cell. With one tool it is told from the last link only in part: tx = a6, tz = d6, trx = alpha6, trz
/// = q6.
class Tool final : public ErrorSource {
 public:
  explicit Tool(const Cell& cell) {
    for (const auto& [id, X_FT] : cell.tools) {
      ids_.push_back(id);
      add_six(parameters_, cell.tools.size() > 1 ? "[" + id + "]" : "");
    }
  }
  std::string name() const override { return "tool"; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override { return "the tool sits on the flange elsewhere than the cell file says"; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    for (std::size_t k = 0; k < ids_.size(); ++k) {
      const int first = 6 * static_cast<int>(k);
      if (ids_[k] == context.tool) move_tool(values.segment<6>(first), state, jacobian, first_column + first);
    }
  }

 private:
  std::vector<std::string> ids_;
  std::vector<Parameter> parameters_;
};

/// From a pose on, the tool sits elsewhere on the flange: it was changed, or knocked.
class ToolChanged final : public ErrorSource {
 public:
  explicit ToolChanged(const SourceSpec& spec) : name_(spec.text), first_(static_cast<int>(spec.at[0]) - 1) {
    add_six(parameters_, fmt::format("@{}", first_ + 1));
  }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("the tool was changed or knocked before pose {}", first_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    if (context.from(first_)) move_tool(values, state, jacobian, first_column);
  }

 private:
  std::string name_;
  int first_;
  std::vector<Parameter> parameters_;
};

}  // namespace

Result<ErrorSourcePtr> make_tool(const SourceSpec&, const Cell& cell) { return std::make_shared<Tool>(cell); }
Result<ErrorSourcePtr> make_tool_changed(const SourceSpec& spec, const Cell&) {
  return std::make_shared<ToolChanged>(spec);
}

}  // namespace trammel
