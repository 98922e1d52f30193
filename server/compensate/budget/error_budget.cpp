#include "server/compensate/budget/error_budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/shown_value.h"
#include "server/base/units.h"
#include "server/compensate/budget/effects.h"
#include "server/compensate/budget/remedies.h"
#include "server/compensate/budget/usual.h"
#include "server/error_sources/catalogue.h"
#include "server/error_sources/spelling.h"
#include "server/measurement/gauges.h"
#include "server/measurement/one_place.h"

namespace trammel {

namespace {

double mean_square(const Eigen::Matrix3Xd& vectors) {
  return vectors.squaredNorm() / static_cast<double>(vectors.cols());
}

double inner(const Eigen::Matrix3Xd& one, const Eigen::Matrix3Xd& other) {
  return one.cwiseProduct(other).sum() / static_cast<double>(one.cols());
}

/// A number as people read it: angles in degrees.
Reading shown(const Parameter& parameter) {
  Reading reading = reading_of(parameter.unit);
  reading.scale *= parameter.scale;
  return reading;
}

double u95(double variance) { return 2 * std::sqrt(std::max(variance, 0.0)); }

/// A joint's zero in the controller's sign: the joint stands at the angle shown plus this.
double counted(const BudgetItem& item, const Chain& robot) {
  return item.line.kind == LineKind::kJointZero ? robot.joint(item.line.joint).sign : 1.0;
}

bool is_frame(LineKind kind) { return kind == LineKind::kBase || kind == LineKind::kTool; }

/// The values of the parameters of a line.
void add_values(const Datum& datum, const std::vector<Parameter>& parameters, BudgetItem& item) {
  BudgetLine& line = item.line;
  for (const Eigen::Index place : item.places) {
    const Parameter& parameter = parameters[static_cast<std::size_t>(place)];
    const auto [scale, unit] = shown(parameter);
    const double sign = counted(item, datum.model.cell->robot);
    line.numbers.push_back({parameter.name, sign * scale * datum.model.values(place),
                            scale * u95(datum.covariance(place, place)), unit});
  }
  if (line.numbers.size() == 1) {
    line.value = line.numbers.front();
    line.numbers.clear();
  } else if (line.kind == LineKind::kLength || line.kind == LineKind::kTwist) {
    line.value = *std::max_element(line.numbers.begin(), line.numbers.end(),
                                   [](const BudgetNumber& one, const BudgetNumber& other) {
                                     return std::abs(one.value) < std::abs(other.value);
                                   });
    line.name = name_of_link_parameter(line.value->name, datum.model.cell->robot);
  } else if (line.kind == LineKind::kBase || line.kind == LineKind::kTool) {
    const Eigen::Vector3d shift = datum.model.values.segment<3>(item.places.front());
    const Matrix3 covariance =
        datum.covariance.block<3, 3>(item.places.front(), item.places.front());
    const double length = shift.norm();
    const Vector3 along = length > 0 ? Vector3(shift / length) : Vector3::UnitX();
    line.value =
        BudgetNumber{"shift", to_mm(length), to_mm(u95(along.dot(covariance * along))), "mm"};
  }
}

/// Judges whether a value is certain, and whether it is far beyond the usual size; then sets the
/// repair.
void judge(const Datum& datum, BudgetItem& item) {
  BudgetLine& line = item.line;
  const std::optional<double> usual = usual_value(item, datum.model);
  if (!usual || !line.value) return;
  line.times_usual = std::abs(line.value->value) / *usual;
  const bool sure = std::abs(line.value->value) - line.value->u95 > *usual;
  if (sure && *line.times_usual > kStandsOut) line.action = action_for(line, datum.model);
}

/// The item that a parameter belongs to; -1: none.
std::ptrdiff_t item_with(const std::vector<BudgetItem>& items, Eigen::Index place) {
  const auto found = std::find_if(items.begin(), items.end(), [&](const BudgetItem& item) {
    return std::find(item.places.begin(), item.places.end(), place) != item.places.end();
  });
  return found == items.end() ? -1 : found - items.begin();
}

void add_name(const std::string& name, std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

/// Reports a line that counts as being on its drawing: beside its partners or, if it has many or
/// none, in one line of undetermined combinations. A frame whose other numbers are counted names
/// its partners, too.
void name_partners(BudgetItem& item, const std::set<std::ptrdiff_t>& partners,
                   std::vector<BudgetItem>& items, BudgetLine& untold) {
  constexpr std::size_t kMostPartners = 2;
  const std::string& name = item.line.line;
  if (partners.empty() || partners.size() > kMostPartners) return add_name(name, untold.with);
  for (const std::ptrdiff_t partner : partners) {
    BudgetLine& other = items[static_cast<std::size_t>(partner)].line;
    add_name(name, other.with);
    if (item.places.size() > 1 && is_frame(item.line.kind)) add_name(other.line, item.line.with);
  }
}

/// Each line that has one of the parameters names the others.
void name_all_of(const std::vector<Eigen::Index>& parameters, std::vector<BudgetItem>& items) {
  std::set<std::ptrdiff_t> together;
  for (const Eigen::Index place : parameters)
    if (const std::ptrdiff_t item = item_with(items, place); item >= 0) together.insert(item);
  for (const std::ptrdiff_t one : together)
    for (const std::ptrdiff_t other : together)
      if (one != other)
        add_name(items[static_cast<std::size_t>(other)].line.line,
                 items[static_cast<std::size_t>(one)].line.with);
}

/// Removes parameters that count as being on their drawing, and lines without any other parameter.
void fold(const Datum& datum, std::vector<BudgetItem>& items, BudgetLine& untold) {
  for (const Datum::OnDrawing& one : datum.on_drawing) {
    const std::ptrdiff_t own = item_with(items, one.parameter);
    if (own < 0) continue;
    BudgetItem& item = items[static_cast<std::size_t>(own)];
    const bool of_links = item.line.kind == LineKind::kLength || item.line.kind == LineKind::kTwist;
    const bool of_frame = is_frame(item.line.kind);
    if (item.places.size() > 1 && !of_links && !of_frame) continue;
    std::set<std::ptrdiff_t> partners;
    for (const Eigen::Index place : one.with) {
      const std::ptrdiff_t partner = item_with(items, place);
      if (partner >= 0 && partner != own) partners.insert(partner);
    }
    if (of_frame && partners.empty()) continue;  // other lines contain its other numbers
    name_partners(item, partners, items, untold);
    if (!of_frame) std::erase(item.places, one.parameter);
  }
  for (const std::vector<Eigen::Index>& parameters : datum.told_together)
    name_all_of(parameters, items);
  std::erase_if(items,
                [](const BudgetItem& item) { return item.places.empty() && !item.whole_source; });
}

BudgetLine named(LineKind kind, std::string name) {
  BudgetLine line;
  line.kind = kind;
  line.line = std::string(to_string(kind));
  line.name = std::move(name);
  return line;
}

/// A position gives three numbers. If there are too few of them, the line states the fewest poses
/// that are enough: as many numbers as there are parameters, with a margin.
BudgetLine untold_line(const Identified& found, int poses) {
  const auto free = static_cast<int>((found.covariance.diagonal().array() > 0).count());
  std::string name = "what these poses cannot tell";
  if (3 * poses < free)
    name += fmt::format(", {} positions for {} numbers: {} poses tell it", poses, free, free);
  return named(LineKind::kUntold, std::move(name));
}

/// Adds sizes and share of a line that does `effect` to the poses, where the error is `total`.
BudgetLine sized(BudgetLine line, const Eigen::Matrix3Xd& effect, const Eigen::Matrix3Xd& total) {
  const double whole = mean_square(total);
  line.alone_rms = std::sqrt(mean_square(effect));
  line.alone_max = effect.colwise().norm().maxCoeff();
  line.share = whole > 0 ? inner(effect, total) / whole : 0;
  line.left_if_right = std::sqrt(mean_square(total - effect));
  return line;
}

/// m², of a position: the noise that the instrument states.
double stated_mean_square(const MeasurementBatch& positions, const Cell& cell) {
  double sum = 0;
  for (const Measurement& m : positions.measurements)
    sum += 3 * std::pow(m.sigma.value_or(cell.tracker.sigma), 2);
  return sum / static_cast<double>(positions.measurements.size());
}

/// Splits the residual into the stated noise of the instrument and the rest.
void add_rest(const Eigen::Matrix3Xd& rest, const Eigen::Matrix3Xd& total, double stated,
              BudgetView& view) {
  const double whole = mean_square(total);
  const double of_instrument = std::min(stated, mean_square(rest));
  BudgetLine left =
      sized(named(LineKind::kRest, "what is left, by no cause that is known"), rest, total);
  left.share -= whole > 0 ? of_instrument / whole : 0;
  left.alone_rms = std::sqrt(mean_square(rest) - of_instrument);
  view.lines.push_back(std::move(left));
  BudgetLine noise = named(LineKind::kInstrument, "the noise that the instrument states");
  noise.alone_rms = std::sqrt(of_instrument);
  noise.alone_max = noise.alone_rms;
  noise.share = whole > 0 ? of_instrument / whole : 0;
  noise.left_if_right = std::sqrt(std::max(whole - of_instrument, 0.0));
  view.lines.push_back(std::move(noise));
}

struct ViewAsked {
  const std::vector<BudgetItem>& items;
  const Effects& effects;
  const BudgetLine& untold;
  double stated = 0;  // m²
  bool has_bias = false;
};

/// `seen` maps vectors at the poses to the part of them that counts.
template <typename Seen>
BudgetView view_of(const ViewAsked& asked, bool frames, const Seen& seen) {
  BudgetView view;
  const Eigen::Matrix3Xd total = seen(asked.effects.total);
  view.error_rms = std::sqrt(mean_square(total));
  for (std::size_t k = 0; k < asked.items.size(); ++k) {
    if (!frames && is_frame(asked.items[k].line.kind)) continue;
    view.lines.push_back(sized(asked.items[k].line, seen(asked.effects.lines[k]), total));
  }
  if (asked.has_bias)
    view.lines.push_back(sized(named(LineKind::kLearned, "what is learned beyond the physics"),
                               seen(asked.effects.learned), total));
  // Lines that stand out lead.
  std::stable_sort(view.lines.begin(), view.lines.end(),
                   [](const BudgetLine& one, const BudgetLine& other) {
                     return one.action.empty() == other.action.empty() ? one.share > other.share
                                                                       : other.action.empty();
                   });
  // The effect of frames is removed from every vector, so their small remainder counts as joint
  // effect.
  Eigen::Matrix3Xd together = asked.effects.together;
  for (std::size_t k = 0; k < asked.items.size(); ++k)
    if (!frames && is_frame(asked.items[k].line.kind)) together += asked.effects.lines[k];
  view.lines.push_back(
      sized(named(LineKind::kTogether, "what the lines do together"), seen(together), total));
  if (!asked.untold.with.empty()) view.lines.push_back(asked.untold);
  add_rest(seen(asked.effects.rest), total, asked.stated, view);
  return view;
}

std::vector<PoseContext> contexts_of(const MeasurementBatch& positions) {
  std::vector<PoseContext> contexts;
  for (const Measurement& m : positions.measurements) contexts.push_back(m.context);
  return contexts;
}

/// The residuals of `positions` by the drawing and by the physics, where nothing is learned.
LeftAt left_by(const PhysicalModel& physics, const MeasurementBatch& positions) {
  const auto n = std::ssize(positions.measurements);
  LeftAt left{Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n), {}};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = positions.measurements[static_cast<std::size_t>(i)];
    left.drawing.col(i) = m.p_W - physics.nominal_pose_W(m.context).translation();
    left.physics.col(i) = m.p_W - physics.pose_W(m.context).translation();
  }
  left.all = left.physics;
  return left;
}

LeftAt left_by(const CompensatedModel& model, const MeasurementBatch& positions) {
  const CompensatedModel::LevelErrors errors = model.errors_B(positions);
  const Matrix3 R_WB = model.parts().physics.X_WB.linear();
  return {R_WB * errors.nominal, R_WB * errors.calibrated, R_WB * errors.compensated};
}

std::vector<PutRight> put_right(const PhysicalModel& model, const std::vector<BudgetItem>& items,
                                const Effects& effects, const MeasurementBatch& positions,
                                const BeyondFrames& beyond_frames) {
  const auto rms = [](const Eigen::Matrix3Xd& vectors) { return std::sqrt(mean_square(vectors)); };
  std::vector<PutRight> steps = {
      {"nothing", "as it stands", rms(effects.total)},
      {"frames", "base and tool frames touched", rms(beyond_frames(effects.total))}};
  std::vector<const BudgetItem*> right;
  for (const auto& [step, name] :
       {std::pair("zeros", "zeros of the joints set in the controller"),
        std::pair("lengths", "lengths and angles of the links, where a controller takes them"),
        std::pair("loads", "load data, where a controller takes the gearboxes into account")}) {
    for (const BudgetItem& item : items)
      if (is_of_step(item.line, step)) right.push_back(&item);
    steps.push_back(
        {step, name, rms(beyond_frames(effects.total - effect_of_all(model, right, positions)))});
  }
  steps.push_back({"trammel", "targets corrected by this model", rms(effects.rest)});
  return steps;
}

Since since_of(const ModelParts& parts) {
  Since since;
  for (const Change& change : parts.changes) {
    const std::vector<std::string> sources = change.sources();
    for (std::size_t k = 0; k < sources.size(); ++k) {
      const std::size_t session = change.steps.empty() ? change.session : k + 1;
      if (session < parts.sessions.size()) since[sources[k]] = parts.sessions[session].id;
    }
  }
  return since;
}

/// The columns of `vectors` at which `effect` is not zero.
std::vector<Eigen::Index> where_it_acts(const Eigen::Matrix3Xd& effect) {
  std::vector<Eigen::Index> columns;
  for (Eigen::Index i = 0; i < effect.cols(); ++i)
    if (!effect.col(i).isZero(0)) columns.push_back(i);
  return columns;
}

/// A change between sessions is named by its session, because row numbers of several files mean
/// nothing to people.
void tell_since(const Since& since, const ErrorSource& source, BudgetLine& line) {
  const auto found = since.find(source.name());
  if (found == since.end()) return;
  line.since_session = found->second;
  line.name =
      fmt::format("{} since session {}", in_words(source.name().substr(0, source.name().find('@'))),
                  line.since_session);
}

std::vector<BudgetLine> between_sessions(const std::vector<BudgetItem>& items,
                                         const Effects& effects) {
  std::vector<BudgetLine> lines;
  for (std::size_t k = 0; k < items.size(); ++k) {
    const std::vector<Eigen::Index> at = where_it_acts(effects.lines[k]);
    if (items[k].line.since_session.empty() || at.empty()) continue;
    lines.push_back(
        sized(items[k].line, effects.lines[k](Eigen::all, at), effects.total(Eigen::all, at)));
  }
  std::stable_sort(lines.begin(), lines.end(), [](const BudgetLine& one, const BudgetLine& other) {
    return one.alone_rms > other.alone_rms;
  });
  return lines;
}

/// Facts beside the parameters.
struct ToldBeside {
  bool has_bias = false;
  Since since = {};
  const PredictedDifference* difference = nullptr;
};

/// If the arms of the two models carry different loads, one line has the whole effect.
void add_load(const PredictedDifference& difference, const PhysicalModel& model,
              std::vector<BudgetItem>& items, Effects& effects) {
  for (std::size_t k = items.size(); k-- > 0;) {
    if (!changes_load(*model.sources[items[k].source])) continue;
    effects.together += effects.lines[k];
    items.erase(items.begin() + static_cast<std::ptrdiff_t>(k));
    effects.lines.erase(effects.lines.begin() + static_cast<std::ptrdiff_t>(k));
  }
  BudgetItem item;
  item.line.line = "payload";
  item.line.cause = "payload";
  item.line.name = "what the arm carries";
  item.line.value = difference.load_change;
  items.push_back(std::move(item));
  effects.lines.push_back(difference.load);
  effects.together -= difference.load;
}

/// `positions` is not empty.
ErrorBudget budget_of(const Identified& found, const LeftAt& left,
                      const MeasurementBatch& positions, const ToldBeside& beside) {
  ErrorBudget budget;
  budget.poses = static_cast<int>(positions.measurements.size());
  const bool is_measured = !positions.measurements.front().context.served;
  const Datum datum =
      datum_of(found, contexts_of(positions), is_measured ? &left.physics : nullptr);
  std::vector<BudgetItem> items = items_of(datum.model);
  BudgetLine untold = untold_line(found, budget.poses);
  fold(datum, items, untold);
  const std::vector<Parameter> parameters = datum.model.parameters();
  for (BudgetItem& item : items) {
    tell_since(beside.since, *datum.model.sources[item.source], item.line);
    add_values(datum, parameters, item);
    judge(datum, item);
  }
  Effects effects = effects_of(left, datum, items, positions);
  budget.between_sessions = between_sessions(items, effects);
  if (beside.difference != nullptr && beside.difference->load.cols() > 0)
    add_load(*beside.difference, datum.model, items, effects);
  const ViewAsked asked{items, effects, untold, stated_mean_square(positions, *datum.model.cell),
                        beside.has_bias};
  budget.as_it_stands = view_of(asked, true, [](const Eigen::Matrix3Xd& all) { return all; });
  const BeyondFrames beyond_frames(datum.model, positions);
  budget.beyond_frames = view_of(asked, false, beyond_frames);
  budget.put_right = put_right(datum.model, items, effects, positions, beyond_frames);
  return budget;
}

}  // namespace

bool tells_a_budget(const MeasurementBatch& measured) {
  return has_positions(measured) && !is_each_tool_at_one_place(measured);
}

ErrorBudget error_budget(const CompensatedModel& model, const MeasurementBatch& measured) {
  const MeasurementBatch positions = positions_of(measured);
  if (positions.measurements.empty()) return {};
  const ModelParts& parts = model.parts();
  return budget_of({parts.physics, parts.parameters, parts.covariance}, left_by(model, positions),
                   positions, {model.bias().has_value(), since_of(parts)});
}

ErrorBudget error_budget(const CompensatedModel& model, const std::vector<PoseContext>& targets) {
  MeasurementBatch as_predicted;
  std::vector<PoseContext> at = targets;
  for (PoseContext& one : at)
    one.served = true;  // a change that began at a training pose has
                        // happened
  const std::vector<ErrorPrediction> predictions = model.predict_all(at);
  for (std::size_t i = 0; i < at.size(); ++i) {
    Measurement m;
    m.context = at[i];
    m.p_W = model.parts().physics.X_WB * predictions[i].X_BT_predicted.translation();
    m.sigma = 0;
    as_predicted.measurements.push_back(std::move(m));
  }
  const MeasurementBatch positions = positions_of(as_predicted);
  if (positions.measurements.empty()) return {};
  const ArmOfNow arm = arm_of_now(model.parts());
  return budget_of({arm.physics, arm.parameters, arm.covariance}, left_by(model, positions),
                   positions, {model.bias().has_value()});
}

ErrorBudget error_budget(const CalibrationResult& between, const PredictedDifference& predicted) {
  MeasurementBatch at;
  for (const PoseContext& pose : predicted.poses) {
    Measurement m;
    m.context = pose;
    m.context.served = true;
    m.sigma = 0;
    at.measurements.push_back(std::move(m));
  }
  const auto n = std::ssize(predicted.poses);
  const LeftAt left{predicted.all, predicted.learned, Eigen::Matrix3Xd::Zero(3, n)};
  return budget_of({between.model, between.parameters, between.covariance}, left, at,
                   {!predicted.learned.isZero(0), {}, &predicted});
}

ErrorBudget error_budget(const CalibrationResult& calibration, const MeasurementBatch& measured,
                         const Since& since) {
  const MeasurementBatch positions = positions_of(measured);
  if (positions.measurements.empty()) return {};
  return budget_of({calibration.model, calibration.parameters, calibration.covariance},
                   left_by(calibration.model, positions), positions, {false, since});
}

double alone_of_zero(const CompensatedModel& model, int joint, double by,
                     const MeasurementBatch& measured) {
  const MeasurementBatch positions = positions_of(measured);
  if (positions.measurements.empty()) return std::numeric_limits<double>::quiet_NaN();
  const PhysicalModel& physics = model.parts().physics;
  // The zero moves its own axis alone, even if the controller couples other joints to it.
  JointVector gears = JointVector::Zero(physics.cell->robot.size());
  gears(joint) = by;
  const JointVector moved = physics.cell->robot.commanded(gears);
  Eigen::Matrix3Xd effect(3, std::ssize(positions.measurements));
  for (Eigen::Index i = 0; i < effect.cols(); ++i) {
    PoseContext context = positions.measurements[static_cast<std::size_t>(i)].context;
    const Vector3 p_W = physics.pose_W(context).translation();
    context.q += moved;
    effect.col(i) = physics.pose_W(context).translation() - p_W;
  }
  return std::sqrt(mean_square(BeyondFrames(physics, positions)(effect)));
}

}  // namespace trammel
