#include "server/tasks/train/among_twins.h"

#include <algorithm>
#include <optional>

namespace trammel {

namespace {

constexpr int kMostUnlike = 8;  // parameters; a robot that differs in more does not belong to the
                                // fleet
constexpr double kWorseFit = 0.7;  // of the residual without the prior: the prior may add this
                                   // share

/// A source with the fleet's values as the expectation of its parameters.
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
  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    source_->apply(context, values, state, jacobian, first_column);
  }
  [[nodiscard]] const ErrorSourcePtr& source() const { return source_; }

 private:
  ErrorSourcePtr source_;
  std::vector<Parameter> parameters_;
};

/// Gives the unchanged sources of `model` the fleet's priors, and its values the prior means.
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
    if (const auto* expected = dynamic_cast<const Expected*>(source.get()))
      source = ErrorSourcePtr(expected->source());
  }
}

/// Every combination of the forms that the causes have.
std::vector<std::vector<std::string>> forms_of(const std::vector<std::string>& sources,
                                               const Cell& cell) {
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

/// The calibration by the form under which the data are most likely.
Result<CalibrationResult> calibrated(const std::shared_ptr<const Cell>& cell,
                                     const std::vector<std::string>& sources,
                                     const MeasurementBatch& batch,
                                     const std::vector<FleetParameter>& priors) {
  std::optional<CalibrationResult> best;
  for (const std::vector<std::string>& forms : forms_of(sources, *cell)) {
    PhysicalModel model = TRY(make_physical_model(cell, forms));
    expect(model, priors);
    Result<CalibrationResult> result = calibrate({std::move(model), batch}, {});
    if (!result) return result;
    if (!best || result->log_likelihood > best->log_likelihood) best = std::move(*result);
  }
  as_drawn(best->model);
  return std::move(*best);
}

/// The parameters found from the poses alone, shrunk linearly towards the twins, so that a wrong
/// prior shows in full. In a new fit, its misfit would pass for noise.
struct Drawn {
  std::vector<IdentifiedParameter> parameters;
  Eigen::MatrixXd covariance;
};

Drawn drawn_to(const CalibrationResult& alone, const std::vector<FleetParameter>& priors) {
  const auto P = static_cast<Eigen::Index>(alone.parameters.size());
  Eigen::VectorXd scale(P), value(P);
  for (Eigen::Index k = 0; k < P; ++k) {
    scale(k) = alone.parameters[static_cast<std::size_t>(k)].parameter.prior_scale;
    value(k) = alone.parameters[static_cast<std::size_t>(k)].value / scale(k);
  }
  const Eigen::VectorXd shrink = scale.cwiseInverse();
  Eigen::MatrixXd covariance = shrink.asDiagonal() * alone.covariance * shrink.asDiagonal();
  covariance.diagonal().array() += 1e-12;  // keeps a certain parameter positive definite under
                                           // rounding
  Eigen::MatrixXd precision = covariance.llt().solve(Eigen::MatrixXd::Identity(P, P));
  Eigen::VectorXd weighted = precision * value;
  Drawn drawn{alone.parameters, {}};
  for (Eigen::Index k = 0; k < P; ++k) {
    IdentifiedParameter& one = drawn.parameters[static_cast<std::size_t>(k)];
    const auto named = [&](const FleetParameter& prior) {
      return prior.name == one.parameter.name;
    };
    const auto prior = std::find_if(priors.begin(), priors.end(), named);
    if (prior == priors.end()) continue;
    const double expected = scale(k) * scale(k) / (prior->next_stddev() * prior->next_stddev());
    precision(k, k) += expected - 1;
    weighted(k) += expected * prior->mean / scale(k) - one.parameter.prior / scale(k);
    one.parameter.prior = prior->mean;
    one.parameter.prior_scale = prior->next_stddev();
  }
  const Eigen::LDLT<Eigen::MatrixXd> factor(precision);
  const Eigen::VectorXd mean = factor.solve(weighted);
  for (Eigen::Index k = 0; k < P; ++k)
    drawn.parameters[static_cast<std::size_t>(k)].value = mean(k) * scale(k);
  covariance = factor.solve(Eigen::MatrixXd::Identity(P, P));
  drawn.covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
  return drawn;
}

}  // namespace

Result<CalibrationResult> calibrate_among_twins(const std::shared_ptr<const Cell>& cell,
                                                const std::vector<std::string>& sources,
                                                const MeasurementBatch& batch,
                                                const FleetPrior& fleet) {
  Result<CalibrationResult> alone = calibrate(cell, sources, batch, {});
  if (!alone) return alone;
  std::vector<FleetParameter> priors = fleet.parameters;
  for (int given_back = 0; given_back <= kMostUnlike; ++given_back) {
    const Drawn drawn = drawn_to(*alone, priors);
    const std::vector<Unlike> unlike = unlike_twins(drawn.parameters, drawn.covariance, fleet);
    const auto is_drawn = [&](const Unlike& one) {
      return std::any_of(priors.begin(), priors.end(),
                         [&](const auto& prior) { return prior.name == one.parameter; });
    };
    const auto odd = std::find_if(unlike.begin(), unlike.end(), is_drawn);
    if (odd != unlike.end()) {
      std::erase_if(priors,
                    [&](const FleetParameter& prior) { return prior.name == odd->parameter; });
      continue;
    }
    Result<CalibrationResult> result = calibrated(cell, sources, batch, priors);
    const double noise = cell->tracker.sigma;
    const bool fits = result && result->discrepancy < kWorseFit * (alone->discrepancy + noise);
    return fits ? std::move(result) : std::move(alone);
  }
  return alone;
}

}  // namespace trammel
