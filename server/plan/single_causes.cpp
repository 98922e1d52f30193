#include "server/plan/single_causes.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "server/robot/arm_state.h"

namespace trammel {

namespace {

using causes::Lasting;
using causes::Numbers;
using causes::Part;
using causes::Scope;
using causes::SearchFamily;
using Eigen::Index;

/// The rival among causes that begin at a pose that equals this cause when it begins at the first
/// pose.
const causes::Rival* begun_before(const CauseRecord& whole, const std::string& parameter,
                                  int joint) {
  for (const CauseRecord* step : all_causes()) {
    const causes::Rival* rival = whole_of(*step);
    if (rival != nullptr && rival->cause == whole.spelling &&
        parameter_of(*rival, joint) == parameter)
      return rival;
  }
  return nullptr;
}

/// True for causes that may have changed while the instrument is as it should be.
bool may_have_changed(const CauseRecord& record) {
  if (record.scope == Scope::kPose || record.scope == Scope::kSession || record.part == Part::kBase)
    return false;
  if (record.search == SearchFamily::kNone || record.search == SearchFamily::kPose) return false;
  // A cause that always acts and the one that begins at a pose are tested as one. Maps of an angle
  // are tested as "any function".
  return record.search != SearchFamily::kMap && begun_before(record, "", -1) == nullptr;
}

bool approached(const std::vector<PoseContext>& poses, int joint, int from) {
  return std::any_of(poses.begin(), poses.end(), [&](const PoseContext& c) {
    return !c.direction.empty() && c.direction[static_cast<std::size_t>(joint)] == from;
  });
}

bool carries(const Cell& cell, const std::vector<PoseContext>& poses) {
  return std::any_of(poses.begin(), poses.end(), [&](const PoseContext& c) {
    const auto found = cell.payloads.find(c.payload);
    return found != cell.payloads.end() && found->second.mass > 0;
  });
}

constexpr std::size_t kMostNumbers = 6;  // of one cause: few poses do not show a cause with more
constexpr double kWarmer = 2;            // K between poses, from which on temperature shows
constexpr double kUnrecorded = 10;       // K: the possible warming of an arm without a recorded
                                         // temperature
constexpr double kOfDrawings = 20;       // degrees Celsius

bool warms(const std::vector<PoseContext>& poses, std::optional<double> learned_at) {
  std::optional<double> low = learned_at, high = learned_at;
  for (const PoseContext& c : poses) {
    if (!c.temperature) return false;
    low = std::min(low.value_or(*c.temperature), *c.temperature);
    high = std::max(high.value_or(*c.temperature), *c.temperature);
  }
  return low && *high - *low > kWarmer;
}

/// True if a temperature shows although it is equal at all poses, since all lengths differ.
bool shows_alike_at_all(const CauseRecord& record) {
  return record.scope == Scope::kArm && record.needs.temperature && !record.needs.history;
}

/// The columns that these poses would have to record; empty where the cause shows.
std::string lacking(const CauseRecord& record, int joint, const Cell& cell,
                    const std::vector<PoseContext>& poses, std::optional<double> learned_at) {
  const ContextNeeds& needs = record.needs;
  if (needs.payload && !carries(cell, poses)) return "a payload";
  if (needs.direction && joint >= 0 &&
      !(approached(poses, joint, 1) && approached(poses, joint, -1)))
    return "approaching the poses from both sides of this joint";
  if (needs.temperature && !warms(poses, learned_at))
    return "temperatures that differ between the poses, or from those of the training";
  if (needs.velocity || needs.time) return "a continuous path with times";
  if (needs.before || needs.history) return "a batch of many poses with their times";
  return "";
}

std::string spelled(const CauseRecord& record, int joint) {
  return fmt::format("{}{}{}", record.spelling, joint < 0 ? "" : fmt::format(":{}", joint + 1),
                     record.lasting == Lasting::kFromAPose ? "@1" : "");
}

CauseNotAsked cause_not_asked(const CauseRecord& record, int joint, const std::string& needs) {
  CauseNotAsked one;
  one.cause.record = &record;
  one.cause.joint = joint;
  one.needs = needs;
  return one;
}

}  // namespace

std::string to_string(const SingleCause& cause) {
  const std::string spelling(cause.record->spelling);
  if (!cause.parameter.empty()) return spelling + ":" + cause.parameter;
  return cause.joint < 0 ? spelling : fmt::format("{}:{}", spelling, cause.joint + 1);
}

std::string in_words(const SingleCause& cause) {
  std::string words = plain_name(*cause.record, cause.joint);
  if (!cause.parameter.empty() && cause.joint < 0) words += fmt::format(" ({})", cause.parameter);
  return words;
}

bool same_cause(const SingleCause& one, const SingleCause& other) {
  return one.record == other.record && one.joint == other.joint && one.parameter == other.parameter;
}

CauseEffects::CauseEffects(PhysicalModel model, const std::vector<PoseContext>& poses,
                           std::optional<double> learned_at)
    : model_(std::move(model)),
      learned_at_(learned_at),
      is_warmth_recorded_(warms(poses, learned_at)) {
  const Chain& robot = model_.cell->robot;
  for (const CauseRecord* record : all_causes()) {
    if (!may_have_changed(*record)) continue;
    const bool of_joint = record->scope == Scope::kJoint;
    for (int joint = of_joint ? 0 : -1; joint < (of_joint ? robot.size() : 0); ++joint) {
      if (record->of_turning_joint && robot.joint(joint).type != JointType::kRevolute) continue;
      const std::string lacks = lacking(*record, joint, *model_.cell, poses, learned_at);
      if (lacks.empty()) {
        add(*record, joint);
      } else if (!shows_alike_at_all(*record)) {
        not_asked_.push_back(cause_not_asked(*record, joint, lacks));
      }
    }
  }
  for (const CauseRecord* record : all_causes()) {
    if (!is_warmth_recorded_ && may_have_changed(*record) && shows_alike_at_all(*record))
      add(*record, -1);
  }
  find_places();
}

void CauseEffects::add(const CauseRecord& record, int joint) {
  if (record.search != SearchFamily::kOrder) {
    if (const ErrorSourcePtr source = source_of(record, joint)) add_numbers(record, joint, *source);
    return;
  }
  const CauseRecord& zero = first_searched_by(SearchFamily::kZeroStep);
  if (const ErrorSourcePtr source = source_of(zero, joint))
    ask({&record, joint, "", true}, source->name(), {0});
}

void CauseEffects::add_numbers(const CauseRecord& record, int joint, const ErrorSource& source) {
  const std::vector<Parameter>& parameters = source.parameters();
  std::vector<Index> all(parameters.size());
  std::iota(all.begin(), all.end(), Index{0});
  const causes::Rival* whole = whole_of(record);
  const bool is_tool = whole != nullptr && cause_spelled(whole->cause).part == Part::kTool;
  if (record.numbers == Numbers::kTogether) {
    if (all.size() > kMostNumbers) return;
    ask({&record, joint, "", false}, source.name(), all);
    if (is_tool) tool_ = causes_.back().columns;
    return;
  }
  for (const Index k : all) {
    const std::string& name = parameters[static_cast<std::size_t>(k)].name;
    bool begins = false;  // tested by itself, in the form that begins at a pose
    for (int j = 0; j < model_.cell->robot.size(); ++j)
      begins = begins || begun_before(record, name, j) != nullptr;
    if (begins) continue;
    const bool one_a_joint = record.numbers == Numbers::kOneAJoint;
    ask({&record, one_a_joint ? static_cast<int>(k) : joint, name, false}, source.name(), {k});
  }
}

void CauseEffects::ask(SingleCause cause, const std::string& source,
                       const std::vector<Index>& numbers) {
  Entry entry{std::move(cause), {}};
  for (const Index k : numbers) {
    entry.columns.push_back(size());
    if (entry.cause.record->needs.temperature) warm_.push_back(size());
    numbers_.push_back({source, k});
  }
  causes_.push_back(std::move(entry));
}

ErrorSourcePtr CauseEffects::source_of(const CauseRecord& record, int joint) {
  const std::string spec = spelled(record, joint);
  for (const ErrorSourcePtr& source : model_.sources) {
    if (source->name() == spec) return source;
    const bool same = &source->cause() == &record && source->joint() == joint;
    if (same && record.lasting == Lasting::kAlways) return source;
  }
  Result<ErrorSourcePtr> made = make_error_source(spec, *model_.cell);
  if (!made) return nullptr;
  const auto count = static_cast<Index>((*made)->parameters().size());
  const Index first = add_source(model_, *made);
  model_.values.segment(first, count).setZero();  // the arm is as its model has it
  return *made;
}

void CauseEffects::find_places() {
  const std::vector<Parameter> parameters = model_.parameters();
  scale_.resize(size());
  for (const Number& number : numbers_) {
    Index first = 0;
    for (const ErrorSourcePtr& source : model_.sources) {
      if (source->name() == number.source) break;
      first += static_cast<Index>(source->parameters().size());
    }
    const Index place = first + number.number;
    scale_(static_cast<Index>(place_.size())) =
        parameters[static_cast<std::size_t>(place)].prior_scale;
    place_.push_back(place);
  }
}

Eigen::MatrixXd CauseEffects::jacobian_at(const PoseContext& context, const Eigen::VectorXd& values,
                                          Pose* X_WT) const {
  Eigen::MatrixXd jacobian;
  *X_WT = model_.pose_W(context, values, &jacobian);
  return jacobian(Eigen::all, place_);
}

PoseEffects CauseEffects::at(const PoseContext& context) const {
  return at(context, Eigen::VectorXd::Zero(size()));
}

Eigen::VectorXd CauseEffects::values_at(const Eigen::VectorXd& numbers) const {
  Eigen::VectorXd values = model_.values;
  for (std::size_t k = 0; k < place_.size(); ++k) {  // two causes may have one place
    const auto column = static_cast<Index>(k);
    values(place_[k]) += numbers(column) * scale_(column);
  }
  return values;
}

Eigen::MatrixXd CauseEffects::by_warmth(const PoseContext& context,
                                        const Eigen::VectorXd& values) const {
  PoseContext learned = context;
  learned.temperature = learned_at_.value_or(kOfDrawings);
  PoseContext now = is_warmth_recorded_ ? context : learned;
  if (!is_warmth_recorded_) *now.temperature += kUnrecorded;
  Pose unused = Pose::Identity();
  return jacobian_at(now, values, &unused)(Eigen::all, warm_) -
         jacobian_at(learned, values, &unused)(Eigen::all, warm_);
}

PoseEffects CauseEffects::at(const PoseContext& context, const Eigen::VectorXd& numbers) const {
  const Eigen::VectorXd values = values_at(numbers);
  Pose X_WT = Pose::Identity();
  Eigen::MatrixXd jacobian = jacobian_at(context, values, &X_WT);
  if (!warm_.empty() && (learned_at_ || !is_warmth_recorded_))
    jacobian(Eigen::all, warm_) = by_warmth(context, values);
  return in_base(X_WT, jacobian);
}

PoseEffects CauseEffects::without_warmth(const PoseContext& context,
                                         const Eigen::VectorXd& numbers) const {
  Pose X_WT = Pose::Identity();
  Eigen::MatrixXd jacobian = jacobian_at(context, values_at(numbers), &X_WT);
  jacobian(Eigen::all, warm_).setZero();
  return in_base(X_WT, jacobian);
}

PoseEffects CauseEffects::in_base(const Pose& X_WT, const Eigen::MatrixXd& jacobian_W) const {
  const Matrix3 R_BW = model_.X_WB.linear().transpose();
  PoseEffects effects;
  effects.X_BT = model_.X_WB.inverse() * X_WT;
  effects.by_cause.resize(6, size());
  effects.by_cause.topRows<3>() = R_BW * jacobian_W.topRows<3>();
  effects.by_cause.bottomRows<3>() = R_BW * jacobian_W.bottomRows<3>();
  effects.by_cause *= scale_.asDiagonal();
  effects.by_base << Matrix3::Identity(), -skew(effects.X_BT.translation()), Matrix3::Zero(),
      Matrix3::Identity();
  return effects;
}

}  // namespace trammel
