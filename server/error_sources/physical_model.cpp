#include "server/error_sources/physical_model.h"

#include <algorithm>

#include "server/base/check.h"

namespace trammel {

namespace {

/// The pose as its causes see it: with the angles of the gears, if the controller counts other
/// angles. Recorded approach directions already refer to the gears.
class AtTheGears {
 public:
  AtTheGears(const Chain& robot, const PoseContext& context) : context_(&context) {
    if (robot.counts_gears()) return;
    PoseContext& own = own_.emplace(context);
    own.q = robot.gear_angles(context.q);
    if (context.velocity) own.velocity = robot.gear_angles(*context.velocity);
    if (context.before) own.before = robot.gear_angles(*context.before);
    context_ = &own;
  }
  AtTheGears(const AtTheGears&) = delete;
  AtTheGears& operator=(const AtTheGears&) = delete;
  const PoseContext& operator*() const { return *context_; }

 private:
  std::optional<PoseContext> own_;
  const PoseContext* context_;
};

}  // namespace

int PhysicalModel::parameter_count() const {
  int count = 0;
  for (const ErrorSourcePtr& source : sources)
    count += static_cast<int>(source->parameters().size());
  return count;
}

std::vector<Parameter> PhysicalModel::parameters() const {
  std::vector<Parameter> all;
  for (const ErrorSourcePtr& source : sources) {
    all.insert(all.end(), source->parameters().begin(), source->parameters().end());
  }
  return all;
}

Eigen::VectorXd PhysicalModel::prior_values() const {
  const std::vector<Parameter> all = parameters();
  Eigen::VectorXd prior(static_cast<Eigen::Index>(all.size()));
  for (std::size_t i = 0; i < all.size(); ++i) prior(static_cast<Eigen::Index>(i)) = all[i].prior;
  return prior;
}

ArmState PhysicalModel::nominal_state(const PoseContext& context) const {
  ArmState state;
  state.chain = &cell->robot;
  state.links = cell->robot.links_at(context.q);
  state.X_WB = X_WB;
  const auto tool = tools.find(context.tool);
  TRAMMEL_CHECK(tool != tools.end());
  state.X_FT = tool->second;
  if (!context.payload.empty()) {
    const auto payload = cell->payloads.find(context.payload);
    TRAMMEL_CHECK(payload != cell->payloads.end());
    state.payload = payload->second;
  }
  state.gravity_W = cell->gravity_W;
  return state;
}

Pose PhysicalModel::nominal_pose_W(const PoseContext& context) const {
  return ArmKinematics(nominal_state(context)).tool_pose_W();
}

ArmState PhysicalModel::state(const PoseContext& context) const {
  ArmState state = nominal_state(context);
  const AtTheGears seen(cell->robot, context);
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    source->apply(*seen, values.segment(first, count), state, nullptr, 0);
    first += count;
  }
  return state;
}

Pose PhysicalModel::pose_W(const PoseContext& context) const {
  return ArmKinematics(state(context)).tool_pose_W();
}

Pose PhysicalModel::pose_W(const PoseContext& context, const Eigen::VectorXd& parameter_values,
                           Eigen::MatrixXd* jacobian) const {
  TRAMMEL_CHECK(parameter_values.size() == parameter_count());
  ArmState state = nominal_state(context);
  std::optional<StateJacobian> by_parameters;
  if (jacobian != nullptr)
    by_parameters.emplace(cell->robot, static_cast<int>(parameter_values.size()));
  const AtTheGears seen(cell->robot, context);
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    source->apply(*seen, parameter_values.segment(first, count), state,
                  by_parameters ? &*by_parameters : nullptr, static_cast<int>(first));
    first += count;
  }
  const ArmKinematics kinematics(state);
  if (jacobian != nullptr) *jacobian = by_parameters->times(kinematics.pose_jacobian());
  return kinematics.tool_pose_W();
}

Eigen::Index add_source(PhysicalModel& model, ErrorSourcePtr source) {
  std::size_t place = 0;
  Eigen::Index first = 0;
  while (place < model.sources.size() && !acts_before(*source, *model.sources[place])) {
    first += static_cast<Eigen::Index>(model.sources[place++]->parameters().size());
  }
  const std::vector<Parameter>& parameters = source->parameters();
  const auto count = static_cast<Eigen::Index>(parameters.size());
  const Eigen::VectorXd after = model.values.tail(model.values.size() - first);
  model.values.conservativeResize(first + count + after.size());
  for (Eigen::Index k = 0; k < count; ++k)
    model.values(first + k) = parameters[static_cast<std::size_t>(k)].prior;
  model.values.tail(after.size()) = after;
  model.sources.insert(model.sources.begin() + static_cast<std::ptrdiff_t>(place),
                       std::move(source));
  return first;
}

namespace {

constexpr std::size_t kMostSources = 500;
constexpr std::size_t kMostSpecBytes = 1000;
constexpr std::size_t kMostParameters = 1300;  // their covariance grows with the square of the
                                               // number

/// Refuses too many sources and spellings that are too long, before any source is made.
Status check_counts(const std::vector<std::string>& specs) {
  if (specs.size() > kMostSources)
    return failure(ErrorCode::kTooLarge, "{} error sources, limit {}", specs.size(), kMostSources)
        .of("error_sources")
        .beyond(specs.size(), kMostSources);
  for (const std::string& spec : specs) {
    if (spec.size() <= kMostSpecBytes) continue;
    return failure(ErrorCode::kTooLarge, "error source '{}...': {} bytes, limit {}",
                   spec.substr(0, 40), spec.size(), kMostSpecBytes)
        .of("error_sources")
        .beyond(spec.size(), kMostSpecBytes);
  }
  return {};
}

}  // namespace

Result<PhysicalModel> make_physical_model(std::shared_ptr<const Cell> cell,
                                          const std::vector<std::string>& specs) {
  TRY(check_counts(specs));
  PhysicalModel model;
  std::size_t parameters = 0;
  for (const std::string& spec : spelled_out(specs, *cell)) {
    ErrorSourcePtr source = TRY(make_error_source(spec, *cell));
    for (const ErrorSourcePtr& other : model.sources) {
      const CauseRecord& cause = other->cause();
      if (&cause == &source->cause() && cause.forms.size() > 1) {
        return failure(ErrorCode::kUsage, "error sources '{}' and '{}' are two forms of one cause",
                       other->name(), spec)
            .of("error_sources")
            .with_text(spec);
      }
      if (other->name() == source->name())
        return failure(ErrorCode::kUsage, "error source '{}' given twice", spec)
            .of("error_sources")
            .with_text(spec);
    }
    parameters += source->parameters().size();
    if (parameters > kMostParameters) {
      return failure(ErrorCode::kTooLarge,
                     "error source '{}': {} parameters with those before it, limit {}", spec,
                     parameters, kMostParameters)
          .of("error_sources")
          .with_text(spec)
          .beyond(parameters, kMostParameters);
    }
    model.sources.push_back(std::move(source));
  }
  std::stable_sort(
      model.sources.begin(), model.sources.end(),
      [](const ErrorSourcePtr& a, const ErrorSourcePtr& b) { return acts_before(*a, *b); });
  model.X_WB = cell->X_WB.value_or(Pose::Identity());
  for (const auto& [name, X_FT] : cell->tools) model.tools[name] = X_FT.value_or(Pose::Identity());
  model.cell = std::move(cell);
  model.values = model.prior_values();
  return model;
}

}  // namespace trammel
