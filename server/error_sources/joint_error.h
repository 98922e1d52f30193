#pragma once

#include <utility>
#include <vector>

#include "server/error_sources/error_source.h"

namespace trammel {

/// A cause that turns joints by known functions of the pose times its parameters.
class JointError : public ErrorSource {
 public:
  /// Parameter `column` turns `joint` by `rate` per unit at this pose.
  struct Term {
    int joint;
    int column;
    double rate;
  };

  [[nodiscard]] const std::vector<Parameter>& parameters() const final { return parameters_; }
  [[nodiscard]] std::string name() const final { return name_; }
  [[nodiscard]] int joint() const final { return joint_; }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const final {
    for (const Term& term : terms(context)) {
      state.add_to_joint(term.joint, term.rate * values(term.column));
      if (jacobian != nullptr)
        jacobian->add_to_joint(term.joint, first_column + term.column, term.rate);
    }
  }

 protected:
  JointError(std::string name, int joint, std::vector<Parameter> parameters)
      : name_(std::move(name)), joint_(joint), parameters_(std::move(parameters)) {}
  [[nodiscard]] virtual std::vector<Term> terms(const PoseContext& context) const = 0;

 private:
  const std::string name_;
  const int joint_;
  const std::vector<Parameter> parameters_;
};

}  // namespace trammel
