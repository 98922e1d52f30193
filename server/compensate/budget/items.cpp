#include "server/compensate/budget/items.h"

#include <algorithm>
#include <map>

#include "server/error_sources/anchors.h"
#include "server/error_sources/spelling.h"

namespace trammel {

namespace {

/// `alpha3` -> {`alpha`, 2}: the letters of a parameter and its joint, 0-based.
struct Symbol {
  std::string letters;
  int joint = -1;
};

Symbol symbol_of(const std::string& parameter) {
  const auto digit = parameter.find_first_of("0123456789");
  if (digit == std::string::npos) return {parameter, -1};
  return {parameter.substr(0, digit), std::stoi(parameter.substr(digit)) - 1};
}

/// The line of a link parameter: the zero of its joint, or the lengths or the angles of its link.
BudgetLine line_of_link(const std::string& parameter, const Chain& robot) {
  const auto [letters, joint] = symbol_of(parameter);
  const bool slides = robot.joint(joint).type == JointType::kPrismatic;
  BudgetLine line;
  line.joint = joint;
  line.kind = letters == "q" || (letters == "d" && slides) ? LineKind::kJointZero
              : letters == "d" || letters == "a"           ? LineKind::kLength
                                                           : LineKind::kTwist;
  const char* word = line.kind == LineKind::kJointZero ? "zero"
                     : line.kind == LineKind::kLength  ? "length"
                                                       : "twist";
  line.line = fmt::format("{}:{}", word, joint + 1);
  line.name = name_of_link_parameter(parameter, robot);
  return line;
}

/// Parameters of tools end in `[ID]` where a cell has several.
std::string tool_of(const std::string& parameter) {
  const auto bracket = parameter.find('[');
  return bracket == std::string::npos
             ? ""
             : parameter.substr(bracket + 1, parameter.size() - bracket - 2);
}

void add_links(const PhysicalModel& model, std::size_t source, Eigen::Index first,
               std::vector<BudgetItem>& items) {
  const std::size_t before = items.size();
  Eigen::Index place = first;
  for (const Parameter& parameter : model.sources[source]->parameters()) {
    BudgetLine line = line_of_link(parameter.name, model.cell->robot);
    const auto same =
        std::find_if(items.begin() + static_cast<std::ptrdiff_t>(before), items.end(),
                     [&](const BudgetItem& item) { return item.line.line == line.line; });
    if (same == items.end()) {
      items.push_back({std::move(line), source, {place}, false});
    } else {
      same->places.push_back(place);
    }
    ++place;
  }
}

void add_tools(const PhysicalModel& model, std::size_t source, Eigen::Index first,
               std::vector<BudgetItem>& items) {
  std::map<std::string, BudgetItem> by_tool;
  Eigen::Index place = first;
  for (const Parameter& parameter : model.sources[source]->parameters()) {
    const std::string tool = tool_of(parameter.name);
    BudgetItem& item = by_tool[tool];
    item.line.line = tool.empty() ? "tool" : "tool:" + tool;
    item.line.kind = LineKind::kTool;
    item.line.name =
        tool.empty() ? "the tool on the flange" : fmt::format("the tool {} on the flange", tool);
    item.source = source;
    item.places.push_back(place++);
  }
  for (auto& [tool, item] : by_tool) items.push_back(std::move(item));
}

void add_gearboxes(const PhysicalModel& model, std::size_t source, Eigen::Index first,
                   std::vector<BudgetItem>& items) {
  const auto joints = std::ssize(model.sources[source]->parameters());
  for (Eigen::Index j = 0; j < joints; ++j) {
    BudgetItem item;
    item.line.line = fmt::format("compliance:{}", j + 1);
    item.line.kind = LineKind::kJointCompliance;
    item.line.joint = static_cast<int>(j);
    item.line.name = fmt::format("joint {} giving way under its load", j + 1);
    item.source = source;
    item.places = {first + j};
    items.push_back(std::move(item));
  }
}

/// `joint_map:4` for `joint_map:4@8+20`: numbers that describe a cause are not part of its name,
/// but the pose at which it begins is.
std::string line_of(const ErrorSource& source) {
  const std::string name = source.name();
  return source.cause().lasting == causes::Lasting::kFromAPose ? name
                                                               : name.substr(0, name.find('@'));
}

BudgetItem whole(const PhysicalModel& model, std::size_t source, Eigen::Index first) {
  const ErrorSource& one = *model.sources[source];
  BudgetItem item;
  item.line.line = line_of(one);
  item.line.kind = one.cause().part == causes::Part::kBase ? LineKind::kBase : LineKind::kCause;
  item.line.cause = one.cause().spelling;
  item.line.joint = one.joint();
  item.line.name =
      item.line.kind == LineKind::kBase ? "the place of the base" : in_words(one.name());
  item.source = source;
  item.whole_source = true;
  for (Eigen::Index k = 0; k < std::ssize(one.parameters()); ++k) item.places.push_back(first + k);
  return item;
}

/// The gearboxes: one parameter for each joint that gives way.
bool is_of_gearboxes(const ErrorSource& source) {
  return source.cause().gives_way && source.cause().numbers == causes::Numbers::kOneAJoint;
}

/// The links' own weights: a load that a training adds beside the gearboxes.
bool is_own_weight(const ErrorSource& source) {
  return source.cause().acts.on == causes::ActsOn::kLoad && source.cause().added_by_data;
}

/// The model without the sources for which `goes` is true.
template <typename Goes>
PhysicalModel without_sources(const PhysicalModel& model, const Goes& goes) {
  PhysicalModel rest = model;
  rest.sources.clear();
  std::vector<double> values;
  Eigen::Index place = 0;
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    const auto count = std::ssize(model.sources[k]->parameters());
    if (!goes(k)) {
      rest.sources.push_back(model.sources[k]);
      for (Eigen::Index i = 0; i < count; ++i) values.push_back(model.values(place + i));
    }
    place += count;
  }
  rest.values = Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
  return rest;
}

}  // namespace

bool is_lost_zero(const CauseRecord& cause) {
  return cause.search == causes::SearchFamily::kZeroStep;
}

ArmOfNow arm_of_now(const ModelParts& parts) {
  const PhysicalModel& physics = parts.physics;
  const std::vector<Parameter> all = physics.parameters();
  const auto count = std::ssize(all);
  Eigen::MatrixXd counts_as = Eigen::MatrixXd::Identity(count, count);
  std::vector<bool> goes(physics.sources.size());
  std::vector<Eigen::Index> kept;
  Eigen::Index place = 0;
  for (std::size_t k = 0; k < physics.sources.size(); ++k) {
    const ErrorSource& source = *physics.sources[k];
    const std::string zero = fmt::format("q{}", source.joint() + 1);
    const auto own = std::find_if(all.begin(), all.end(),
                                  [&](const Parameter& one) { return one.name == zero; });
    goes[k] = is_lost_zero(source.cause()) && own != all.end();
    if (goes[k])
      counts_as(own - all.begin(), place) = physics.cell->robot.joint(source.joint()).sign;
    for (std::size_t i = 0; i < source.parameters().size(); ++i, ++place)
      if (!goes[k]) kept.push_back(place);
  }
  const Eigen::MatrixXd taken = counts_as(kept, Eigen::all);
  const Eigen::VectorXd values = taken * physics.values;
  ArmOfNow now{without_sources(physics, [&](std::size_t k) { return goes[k]; }),
               {},
               taken * parts.covariance * taken.transpose()};
  now.physics.values = values;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const auto own = static_cast<Eigen::Index>(i);
    now.parameters.push_back(parts.parameters[static_cast<std::size_t>(kept[i])]);
    now.parameters.back().value = values(own);
    now.parameters.back().stddev = std::sqrt(std::max(now.covariance(own, own), 0.0));
  }
  return now;
}

std::string name_of_link_parameter(const std::string& parameter, const Chain& robot) {
  const auto [letters, joint] = symbol_of(parameter);
  const int n = joint + 1;
  if (letters == "q" || (letters == "d" && robot.joint(joint).type == JointType::kPrismatic))
    return fmt::format("the zero of joint {}", n);
  if (letters == "a") return fmt::format("the length of link {} ({})", n, parameter);
  if (letters == "d") return fmt::format("the offset of link {} ({})", n, parameter);
  return n < robot.size()
             ? fmt::format("the angle between axes {} and {} ({})", n, n + 1, parameter)
             : fmt::format("the angle of the flange to axis {} ({})", n, parameter);
}

std::vector<BudgetItem> items_of(const PhysicalModel& model) {
  std::vector<BudgetItem> items;
  Eigen::Index first = 0;
  for (std::size_t k = 0; k < model.sources.size(); ++k) {
    const ErrorSource& source = *model.sources[k];
    const auto count = std::ssize(source.parameters());
    if (source.cause().part == causes::Part::kLinks) {
      add_links(model, k, first, items);
    } else if (source.cause().part == causes::Part::kTool) {
      add_tools(model, k, first, items);
    } else if (is_of_gearboxes(source)) {
      add_gearboxes(model, k, first, items);
    } else if (!is_of_instruments(source) && !is_own_weight(source)) {
      items.push_back(whole(model, k, first));
    }
    first += count;
  }
  return items;
}

PhysicalModel without(const PhysicalModel& model, const BudgetItem& item) {
  if (item.whole_source)
    return without_sources(model, [&](std::size_t k) { return k == item.source; });
  PhysicalModel rest = model;
  for (const Eigen::Index place : item.places) rest.values(place) = 0;
  return rest;
}

bool changes_load(const ErrorSource& source) {
  return source.cause().acts.on == causes::ActsOn::kLoad && !is_own_weight(source);
}

PhysicalModel with_load_of(const PhysicalModel& model, const PhysicalModel& other) {
  PhysicalModel result = with_told_load(model);
  Cell cell = *model.cell;
  for (const auto& [id, payload] : other.cell->payloads) cell.payloads[id] = payload;
  result.cell = std::make_shared<const Cell>(std::move(cell));
  Eigen::Index place = 0;
  for (const ErrorSourcePtr& source : other.sources) {
    const auto count = std::ssize(source->parameters());
    if (changes_load(*source)) {
      const Eigen::Index first = add_source(result, source);
      result.values.segment(first, count) = other.values.segment(place, count);
    }
    place += count;
  }
  return result;
}

PhysicalModel with_told_load(const PhysicalModel& model) {
  return without_sources(model, [&](std::size_t k) { return changes_load(*model.sources[k]); });
}

BudgetItem in_told_load(const PhysicalModel& model, const BudgetItem& item) {
  Eigen::Index gone = 0;
  std::size_t sources_gone = 0;
  for (std::size_t k = 0; k < item.source; ++k) {
    if (!changes_load(*model.sources[k])) continue;
    gone += std::ssize(model.sources[k]->parameters());
    ++sources_gone;
  }
  BudgetItem moved = item;
  moved.source -= sources_gone;
  for (Eigen::Index& place : moved.places) place -= gone;
  return moved;
}

}  // namespace trammel
