#include "server/diagnose/families/candidates.h"

#include <algorithm>
#include <numeric>

#include "server/diagnose/thresholds.h"
#include "server/robot/passive_joint.h"

namespace trammel::cause_search {

namespace {

constexpr double kPriorOfZero = 1e-3;  // rad
constexpr double kPriorOfSize = 1e-4;  // of the arm

using causes::Lasting;
using causes::Numbers;
using causes::Part;
using causes::Scope;
using causes::SearchFamily;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool any(const MeasurementBatch& batch, const std::function<bool(const PoseContext&)>& has) {
  return std::any_of(batch.measurements.begin(), batch.measurements.end(),
                     [&](const Measurement& m) { return has(m.context); });
}

bool every(const MeasurementBatch& batch, const std::function<bool(const PoseContext&)>& has) {
  return !any(batch, [&](const PoseContext& context) { return !has(context); });
}

bool approached(const MeasurementBatch& batch, int joint, int from) {
  return any(batch, [&](const PoseContext& c) {
    return !c.direction.empty() && c.direction[static_cast<std::size_t>(joint)] == from;
  });
}

double warming(const MeasurementBatch& batch) {
  double low = 1e9;
  double high = -1e9;
  for (const Measurement& m : batch.measurements) {
    if (!m.context.temperature) continue;
    low = std::min(low, *m.context.temperature);
    high = std::max(high, *m.context.temperature);
  }
  return high - low;
}

double heaviest(const Cell& cell) {
  double mass = 0;
  for (const auto& [id, payload] : cell.payloads) mass = std::max(mass, payload.mass);
  return mass;
}

/// The records that `batch` would need for a cause of `joint` (-1: of no single one) to show; empty
/// where it does.
std::string lacking(const ContextNeeds& needs, const Cell& cell, const MeasurementBatch& batch,
                    int joint) {
  if (needs.payload && heaviest(cell) <= 0) return "a payload in the cell file, with its mass";
  if (needs.direction && !every(batch, [](const PoseContext& c) { return !c.direction.empty(); }))
    return "the approach direction of every pose (dir columns)";
  if (needs.direction && joint >= 0) {
    const bool up = approached(batch, joint, 1);
    const bool down = approached(batch, joint, -1);
    if (up != down) return "approaching the poses from both sides of this joint";
    if (!up) return "the approach direction of each pose (dir columns), both occurring";
  }
  if (needs.time && !every(batch, [](const PoseContext& c) { return c.time.has_value(); }))
    return "the time of every pose (time_s)";
  if (needs.velocity && !any(batch, [](const PoseContext& c) { return c.velocity.has_value(); }))
    return "a continuous path with times (time_s)";
  if (needs.stand && !cell.tracker.p_W)
    return "where the instrument stands (tracker: xyz_mm in the cell file)";
  if (needs.before && !any(batch, [](const PoseContext& c) { return c.before.has_value(); }))
    return "the time of every pose (time_s), in the order in which they were measured";
  if (needs.history && !every(batch, [](const PoseContext& c) { return !c.lagged.empty(); }))
    return "the temperature and the time of every pose (temperature_c, time_s)";
  if (needs.temperature &&
      !(every(batch, [](const PoseContext& c) { return c.temperature.has_value(); }) &&
        warming(batch) > thresholds::kSameTemperature))
    return "the temperature of every pose (temperature_c), differing between poses";
  return "";
}

/// Each cause with each of its possible joints (-1 for a cause without joint), in the order of the
/// search: consecutive causes of a joint in the catalogue are taken joint by joint.
template <typename Take>
void for_each_cause(const Chain& robot, const Take& take) {
  const std::vector<const CauseRecord*> all = all_causes();
  const auto is_of_joint = [](const CauseRecord* record) { return record->scope == Scope::kJoint; };
  for (auto first = all.begin(); first != all.end();) {
    if (!is_of_joint(*first)) {
      take(**first++, -1);
      continue;
    }
    const auto last = std::find_if_not(first, all.end(), is_of_joint);
    for (int joint = 0; joint < robot.size(); ++joint) {
      for (auto one = first; one != last; ++one) {
        if (is_passive(robot.joint(joint))) continue;  // it has no gear
        if (!(*one)->of_turning_joint || robot.joint(joint).type == JointType::kRevolute)
          take(**one, joint);
      }
    }
    first = last;
  }
}

/// The spelling in a list of error sources, without the first pose.
std::string spelled(const CauseRecord& record, int joint) {
  return to_string(cause_at(record, joint));
}

/// The spelling of a cause that acts at all poses.
std::string always_acting(const CauseRecord& record, int joint) {
  return spelled(record, joint) + (record.lasting == Lasting::kFromAPose ? "@1" : "");
}

/// True if the cause is looked for by the derivative of an error source of its own.
bool has_own_columns(const CauseRecord& record) {
  return record.search == SearchFamily::kColumns || record.search == SearchFamily::kPlay ||
         record.search == SearchFamily::kStep;
}

const Effect* effect_of(const LinearProblem& problem, std::string_view source) {
  const auto found = std::find_if(problem.effects().begin(), problem.effects().end(),
                                  [&](const Effect& effect) { return effect.source == source; });
  return found == problem.effects().end() ? nullptr : &*found;
}

/// nat: by how much the cause is less expected while the model lacks a simpler cause.
double surprise_of(const CauseRecord& record, const LinearProblem& problem) {
  double surprise = 0;
  for (const causes::Rival& rival : record.rivals) {
    if (rival.surprise > 0 && effect_of(problem, rival.cause) != nullptr)
      surprise += rival.surprise;
  }
  return surprise;
}

/// R: the whitened effect of the whole arm growing by kPriorOfSize: everything moves away from the
/// base.
VectorXd size_of_arm(const LinearProblem& problem) {
  VectorXd column = VectorXd::Zero(problem.rows());
  for (Index i = 0; i < problem.poses(); ++i) {
    const PoseContext& context = problem.batch().measurements[static_cast<std::size_t>(i)].context;
    const ArmState state = problem.model().state(context);
    const Index row = problem.first_row(i);
    column.segment<3>(row) =
        kPriorOfSize * (problem.model().pose_W(context).translation() - state.X_WB.translation());
  }
  return column.cwiseProduct(problem.weight());
}

std::vector<Index> all_columns(const Effect& effect) {
  std::vector<Index> all(effect.parameters.size());
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

/// Families of one cause of one joint.
class Families {
 public:
  explicit Families(const LinearProblem& problem) : problem_(problem) {}

  void add(FamilyPtr family) {
    if (family) all_.push_back(std::move(family));
  }
  void add(const CauseRecord& record, int joint) {
    const Cause cause = cause_at(record, joint);
    switch (record.search) {
      case SearchFamily::kNone:
        return;
      case SearchFamily::kColumns:
      case SearchFamily::kPlay:
        return add_fixed(record, cause);
      case SearchFamily::kStep:
        if (const Effect* effect = effect_of(problem_, always_acting(record, joint)))
          add(make_step_family(problem_, *effect, cause, spelled(record, joint)));
        return;
      case SearchFamily::kZeroStep:
        return add_zero_step(record, cause);
      case SearchFamily::kOrder:
        return add(make_order_family(problem_, cause));
      case SearchFamily::kMap:
        return add(make_joint_map_family(problem_, cause));
      case SearchFamily::kPose:
        return add(make_pose_family(problem_, cause));
    }
  }
  /// A zero may move slowly where it may be lost at once.
  void add_slow(const CauseRecord& record, int joint) {
    if (record.search != SearchFamily::kZeroStep) return;
    const MatrixXd columns = kPriorOfZero * problem_.by_joint().col(joint);
    add(make_slow_family(problem_, columns, fmt::format("the zero of joint {}", joint + 1), joint));
  }
  std::vector<FamilyPtr> take() { return std::move(all_); }

 private:
  void add_fixed(const CauseRecord& record, const Cause& cause) {
    const Effect* effect = effect_of(problem_, to_string(cause));
    if (effect == nullptr) return;
    add(make_fixed_family(problem_, *effect, cause, all_columns(*effect),
                          surprise_of(record, problem_)));
    if (record.numbers == Numbers::kTogether || effect->parameters.size() < 2) return;
    for (std::size_t k = 0; k < effect->parameters.size(); ++k) {
      Cause single = cause;
      single.parameter = effect->parameters[k].name;
      if (record.numbers == Numbers::kOneAJoint) single.joint = static_cast<int>(k);
      add(make_fixed_family(problem_, *effect, single, {static_cast<Index>(k)}));
    }
  }
  /// A joint's own column is there already, per radian.
  void add_zero_step(const CauseRecord& record, const Cause& cause) {
    const std::string spec = always_acting(record, cause.joint);
    const Result<ErrorSourcePtr> source = make_error_source(spec, *problem_.model().cell);
    if (!source) return;
    const Effect slip{
        spec,
        {},
        (*source)->parameters().front().prior_scale * problem_.by_joint().col(cause.joint)};
    add(make_step_family(problem_, slip, cause, to_string(cause)));
  }

  const LinearProblem& problem_;
  std::vector<FamilyPtr> all_;
};

}  // namespace

std::vector<std::string> candidate_sources(const Cell& cell, const MeasurementBatch& batch,
                                           std::vector<Unseen>* unseen) {
  std::vector<std::string> sources;
  for_each_cause(cell.robot, [&](const CauseRecord& record, int joint) {
    if (!has_own_columns(record)) return;
    // A joint is driven past another one from the third joint on, past the one before.
    if (record.takes_numbers && joint >= 0 && joint < 2) return;
    const std::string lacks = lacking(record.needs, cell, batch, joint);
    const std::string spec = always_acting(record, joint);
    if (lacks.empty()) {
      if (make_error_source(spec, cell)) sources.push_back(spec);
      return;
    }
    // An absent payload is reported once, for the payload itself.
    const bool said_elsewhere = record.needs.payload && (record.part != Part::kPayload);
    if (unseen != nullptr && !said_elsewhere)
      unseen->push_back({cause_at(record, joint), 0, {}, {}, lacks});
  });
  return sources;
}

bool is_path_without_times(const MeasurementBatch& batch) {
  for (std::size_t i = 1; i < batch.measurements.size(); ++i) {
    const JointVector step = batch.measurements[i].context.q - batch.measurements[i - 1].context.q;
    if (step.cwiseAbs().maxCoeff() > thresholds::kPathStep) return false;
  }
  return !any(batch, [](const PoseContext& c) { return c.velocity.has_value(); });
}

std::vector<FamilyPtr> make_families(const LinearProblem& problem) {
  const Chain& robot = problem.model().cell->robot;
  Families families(problem);
  for_each_cause(robot, [&](const CauseRecord& record, int joint) { families.add(record, joint); });
  // Along such a path a lag continues just as smoothly.
  if (!is_path_without_times(problem.batch())) {
    for_each_cause(robot,
                   [&](const CauseRecord& record, int joint) { families.add_slow(record, joint); });
    families.add(make_slow_family(problem, size_of_arm(problem), "the size of the arm", -1));
  }
  families.add(make_attitude_family(problem));
  families.add(make_anonymous_family(problem, {}));
  for (int joint = 0; joint < robot.size(); ++joint) {
    families.add(make_anonymous_family(problem, {joint}));
    for (int other = joint + 1; other < robot.size(); ++other)
      families.add(make_anonymous_family(problem, {joint, other}));
  }
  return families.take();
}

bool has_cause(const PhysicalModel& model, const Cause& cause) {
  return std::any_of(model.sources.begin(), model.sources.end(), [&](const ErrorSourcePtr& one) {
    return one->cause().spelling == cause.cause && one->joint() == cause.joint;
  });
}

Cause cause_of(const ErrorSource& source, const MeasurementBatch& batch) {
  Cause cause = cause_at(source.cause(), source.joint());
  if (source.cause().lasting != Lasting::kFromAPose) return cause;
  const std::string name = source.name();
  const int index = std::stoi(name.substr(name.find('@') + 1)) - 1;
  for (const Measurement& m : batch.measurements) {
    if (m.context.index == index) cause.pose_id = m.pose_id;
  }
  return cause;
}

}  // namespace trammel::cause_search
