#include "server/trainer/pipeline/among_twins.h"

#include <algorithm>
#include <optional>

namespace trammel {

namespace {

constexpr int kMostUnlike = 8;  // parameters; a robot that differs in more is none of this fleet

/// A source whose parameters are expected where the fleet has them.
class Expected final : public ErrorSource {
 public:
  Expected(ErrorSourcePtr source, std::vector<Parameter> parameters)
      : source_(std::move(source)), parameters_(std::move(parameters)) {}
  const CauseRecord& cause() const override { return source_->cause(); }
  std::string name() const override { return source_->name(); }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return source_->joint(); }
  std::optional<Search> search() const override { return source_->search(); }
  std::string explanation() const override { return source_->explanation(); }
  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    source_->apply(context, values, state, jacobian, first_column);
  }
  [[nodiscard]] const ErrorSourcePtr& source() const { return source_; }

 private:
  ErrorSourcePtr source_;
  std::vector<Parameter> parameters_;
};

/// The sources of `model` as they are, with the fleet's priors; its values at these.
void expect(PhysicalModel& model, const std::vector<FleetParameter>& priors) {
  for (ErrorSourcePtr& source : model.sources) {
    std::vector<Parameter> parameters = source->parameters();
    bool any = false;
    for (Parameter& parameter : parameters) {
      const auto named = [&](const FleetParameter& one) { return one.name == parameter.name; };
      const auto known = std::find_if(priors.begin(), priors.end(), named);
      if (known == priors.end()) continue;
      parameter.prior = known->mean;
      parameter.prior_scale = known->next_stddev();
      any = true;
    }
    if (any) source = std::make_shared<Expected>(source, std::move(parameters));
  }
  model.values = model.prior_values();
}

void as_drawn(PhysicalModel& model) {
  for (ErrorSourcePtr& source : model.sources) {
    if (const auto* expected = dynamic_cast<const Expected*>(source.get())) source = ErrorSourcePtr(expected->source());
  }
}

/// Every combination of the forms that the causes have.
std::vector<std::vector<std::string>> forms_of(const std::vector<std::string>& sources, const Cell& cell) {
  std::vector<std::vector<std::string>> all = {{}};
  for (const std::string& spec : sources) {
    std::vector<std::vector<std::string>> longer;
    for (const auto& one : all) {
      for (const std::string& form : alternatives(spec, cell)) {
        longer.push_back(one);
        longer.back().push_back(form);
      }
    }
    all = std::move(longer);
  }
  return all;
}

/// Of the forms the one under which the data are most likely.
Result<CalibrationResult> calibrated(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
                                     const MeasurementBatch& batch, const std::vector<FleetParameter>& priors) {
  std::optional<CalibrationResult> best;
  for (const std::vector<std::string>& forms : forms_of(sources, *cell)) {
    Result<PhysicalModel> model = make_physical_model(cell, forms);
    if (!model) return tl::make_unexpected(model.error());
    expect(*model, priors);
    Result<CalibrationResult> result = calibrate({std::move(*model), batch}, {});
    if (!result) return result;
    if (!best || result->log_likelihood > best->log_likelihood) best = std::move(*result);
  }
  as_drawn(best->model);
  return std::move(*best);
}

}  // namespace

Result<CalibrationResult> calibrate_among_twins(const std::shared_ptr<const Cell>& cell,
                                                const std::vector<std::string>& sources, const MeasurementBatch& batch,
                                                const FleetPrior& fleet) {
  std::vector<FleetParameter> priors = fleet.parameters;
  for (int given_back = 0; given_back <= kMostUnlike; ++given_back) {
    Result<CalibrationResult> result = calibrated(cell, sources, batch, priors);
    if (!result) return result;
    const std::vector<Unlike> unlike = unlike_twins(result->parameters, result->covariance, fleet);
    const auto is_drawn = [&](const Unlike& one) {
      return std::any_of(priors.begin(), priors.end(), [&](const auto& prior) { return prior.name == one.parameter; });
    };
    const auto drawn = std::find_if(unlike.begin(), unlike.end(), is_drawn);
    if (drawn == unlike.end()) return result;
    std::erase_if(priors, [&](const FleetParameter& prior) { return prior.name == drawn->parameter; });
  }
  return calibrate(cell, sources, batch, {});
}

}  // namespace trammel
