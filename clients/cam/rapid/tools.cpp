#include "clients/cam/rapid/tools.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/cam/cell_tools.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

Data part(const Data& of, std::size_t index) {
  return {&of.node->parts[index], of.scope, of.type, of.declared};
}

bool is_same(const std::optional<StatedLoad>& a, const std::optional<StatedLoad>& b) {
  return a.has_value() == b.has_value() && (!a || (a->mass == b->mass && a->p_F == b->p_F));
}

/// The load on the flange: a gripped load, whose centre is given in the tool, plus the tool's own
/// load if it is stated.
StatedLoad together(const StatedLoad& gripped, const std::optional<StatedLoad>& own,
                    const std::optional<Pose>& X_FT) {
  StatedLoad all = gripped;
  all.has_centre = X_FT.has_value();
  if (X_FT) all.p_F = *X_FT * gripped.p_F;
  if (!own || is_placeholder(*own)) return all;
  all.p_F = (all.p_F * gripped.mass + own->p_F * own->mass) / (gripped.mass + own->mass);
  all.mass = gripped.mass + own->mass;
  return all;
}

}  // namespace

Tools::Tools(Interpreter& meaning, const ReadOptions& options, Program& program)
    : meaning_(meaning), options_(options), program_(program) {
  program_.frames.push_back({"wobj0", Pose::Identity(), ""});
}

bool Tools::Load::operator==(const Load& other) const {
  return name == other.name && why_not == other.why_not && total == other.total &&
         is_same(load, other.load);
}

ProgramTool Tools::declared_tool(const Data& data) const {
  ProgramTool tool;
  tool.name = data.declared->spelled;
  tool.file = program_.files[data.scope->module].name;
  tool.line = data.declared->line;
  read_tool(data, tool);
  return tool;
}

ProgramFrame Tools::declared_frame(const Data& data) const {
  ProgramFrame frame;
  frame.name = data.declared->spelled;
  const Told<Data> parts = aggregate(data, 5);
  if (parts) read_frame(*parts, frame);
  if (!parts) frame.why_not = fmt::format("work object {}: {}", shown(frame.name), parts.error());
  return frame;
}

std::size_t Tools::undecided_load(std::size_t load, const std::string& why) {
  if (!loads_[load].why_not.empty()) return load;
  Load undecided;
  undecided.name = "GripLoad";
  undecided.why_not = why;
  return known_load(std::move(undecided));
}

std::size_t Tools::known_tool(ProgramTool tool) {
  for (std::size_t k = 0; k < program_.tools.size(); ++k) {
    const ProgramTool& known = program_.tools[k];
    if (lower(known.name) == lower(tool.name) && known.file == tool.file &&
        known.line == tool.line && known.carries == tool.carries &&
        known.X_FT.has_value() == tool.X_FT.has_value() &&
        (!tool.X_FT || known.X_FT->isApprox(*tool.X_FT, 1e-12)))
      return k;
  }
  program_.tools.push_back(std::move(tool));
  return program_.tools.size() - 1;
}

/// The aggregate of `parts` parts that `of` is or stands for. `of` is a part of a tool or of a work
/// object.
Told<Data> Tools::aggregate(const Data& of, std::size_t parts) const {
  Data now = of;
  for (int depth = 0; now.node->kind != Kind::kAggregate && depth < 10; ++depth) {
    const Told<std::vector<Data>> inner = meaning_.data_of(*now.node, *now.scope);
    if (!inner) return because(inner.error());
    if (inner->size() != 1 || inner->front().node == now.node)
      return because("it is not written out");
    now = inner->front();
  }
  if (now.node->kind != Kind::kAggregate || now.node->parts.size() != parts)
    return because(fmt::format("a {} without its {} parts", shown(of.type), parts));
  return now;
}

Told<Pose> Tools::pose(const Data& of, int* rotation_decimals) const {
  const Told<Data> both = aggregate(of, 2);
  if (!both) return because(both.error());
  int ignored = 0;
  const Told<std::vector<double>> p =
      meaning_.numbers_of(both->node->parts[0], 3, *both->scope, &ignored);
  if (!p) return because(p.error());
  const Told<std::vector<double>> q =
      meaning_.numbers_of(both->node->parts[1], 4, *both->scope, rotation_decimals);
  if (!q) return because(q.error());
  std::vector<double> numbers = *p;
  numbers.insert(numbers.end(), q->begin(), q->end());
  if (std::abs(Eigen::Vector4d((*q)[0], (*q)[1], (*q)[2], (*q)[3]).norm() - 1) > 0.01)
    return because("a quaternion that is not of length 1");
  return pose_of(Coordinates::kQuaternion, numbers);
}

Told<bool> Tools::truth(const Data& of) const {
  if (of.node->kind == Kind::kTruth) return of.node->name == "true";
  const Told<std::vector<Data>> data = meaning_.data_of(*of.node, *of.scope);
  if (!data || data->size() != 1 || data->front().node->kind != Kind::kTruth)
    return because("it is not constant");
  return data->front().node->name == "true";
}

/// The data of a tool or work object that an argument names; an error if the files do not have it.
Told<Data> Tools::named(const Expression& argument, const Scope& scope) const {
  const Told<std::vector<Data>> data = meaning_.data_of(argument, scope);
  if (!data) return because(data.error());
  if (data->size() != 1)
    return because(fmt::format("an index chooses {}", shown(meaning_.text_of(argument, scope))));
  return data->front();
}

std::size_t Tools::tool_of(const Expression& argument, const Scope& scope) {
  ProgramTool tool;
  tool.name = meaning_.text_of(argument, scope);
  const auto handed = meaning_.handed_over(argument, scope);
  if (!handed) {
    tool.why_not = handed.error();
    return known_tool(std::move(tool));
  }
  const auto& [expression, where] = *handed;
  tool.name = meaning_.text_of(*expression, *where);
  if (expression->kind == Kind::kName && !meaning_.find(expression->name, *where)) {
    if (expression->name == "tool0") tool.X_FT = Pose::Identity();
    if (!tool.X_FT) take_row(tool.name, options_, tool);
    return known_tool(std::move(tool));
  }
  const Told<Data> data = named(*expression, *where);
  if (!data) {
    tool.why_not = data.error();
    return known_tool(std::move(tool));
  }
  const auto [seen, fresh] = tool_at_.emplace(data->node, 0);
  if (!fresh) return seen->second;
  tool.file = program_.files[data->scope->module].name;
  tool.line = data->node->line;
  read_tool(*data, tool);
  return seen->second = known_tool(std::move(tool));
}

void Tools::read_tool(const Data& data, ProgramTool& tool) const {
  const Told<Data> parts = aggregate(data, 3);
  const Told<bool> held = parts ? truth(part(*parts, 0)) : because(parts.error());
  int decimals = 0;
  const Told<Pose> X_FT = parts ? pose(part(*parts, 1), &decimals) : because("");
  if (!held || !X_FT) {
    tool.why_not = fmt::format("tool {}: {}", shown(tool.name), held ? X_FT.error() : held.error());
    return;
  }
  tool.X_FT = *X_FT;
  tool.rotation_rounding = 2 * std::pow(10.0, -decimals);
  if (!*held) tool.why_not = fmt::format("tool {} is not held by the robot", shown(tool.name));
  tool.load = load_of(part(*parts, 2));
  if (const std::string found = meaning_.load_found(data.declared); !found.empty()) {
    tool.load.reset();
    tool.load_note = fmt::format(
        "the load of tool {} is found at run time (LoadId, {}): it is not compared with the cell's",
        shown(tool.name), found);
  }
}

std::optional<StatedLoad> Tools::load_of(const Data& data) const {
  const Told<Data> load = aggregate(data, 6);
  if (!load) return std::nullopt;
  int ignored = 0;
  const Told<double> mass = meaning_.number_of(load->node->parts[0], *load->scope);
  const Told<std::vector<double>> cog =
      meaning_.numbers_of(load->node->parts[1], 3, *load->scope, &ignored);
  if (!mass || !cog) return std::nullopt;
  return StatedLoad{*mass, Vector3((*cog)[0], (*cog)[1], (*cog)[2]) * from_mm(1)};
}

std::size_t Tools::frame_of(const Expression* argument, const Scope& scope) {
  if (argument == nullptr) return 0;
  ProgramFrame frame;
  frame.name = meaning_.text_of(*argument, scope);
  if (frame.name.empty()) frame.name = "\\WObj";
  const auto handed = meaning_.handed_over(*argument, scope);
  if (!handed) {
    frame.why_not = handed.error();
    return add_once(program_, std::move(frame));
  }
  const auto& [expression, where] = *handed;
  frame.name = meaning_.text_of(*expression, *where);
  if (expression->kind == Kind::kName && !meaning_.find(expression->name, *where)) {
    if (expression->name == "wobj0") return 0;
    if (!take_row(frame.name, options_, frame))
      frame.why_not =
          fmt::format("work object {} is not in the files handed over: --frames tells its value",
                      shown(frame.name));
    return add_once(program_, std::move(frame));
  }
  const Told<Data> data = named(*expression, *where);
  if (data) {
    if (const auto seen = frame_at_.find(data->node); seen != frame_at_.end()) return seen->second;
  }
  const Told<Data> parts = data ? aggregate(*data, 5) : because(data.error());
  if (!parts) {
    frame.why_not = fmt::format("work object {}: {}", shown(frame.name), parts.error());
    return add_once(program_, std::move(frame));
  }
  read_frame(*parts, frame);
  return frame_at_[data->node] = add_once(program_, std::move(frame));
}

void Tools::read_frame(const Data& parts, ProgramFrame& frame) const {
  const Told<bool> held = truth(part(parts, 0));
  const Told<bool> fixed = truth(part(parts, 1));
  int ignored = 0;
  const Told<Pose> user = pose(part(parts, 3), &ignored);
  const Told<Pose> object = pose(part(parts, 4), &ignored);
  std::string why;
  if (!held || !fixed || !user || !object) {
    why = !held ? held.error() : !fixed ? fixed.error() : !user ? user.error() : object.error();
  } else if (*held) {
    why = "it is held by the robot";
  } else if (!*fixed) {
    why = "a mechanical unit moves it";
  } else {
    frame.X_BO = *user * *object;
    return;
  }
  frame.why_not = fmt::format("work object {}: {}", shown(frame.name), why);
}

std::size_t Tools::known_load(Load load) {
  const auto known = std::find(loads_.begin(), loads_.end(), load);
  if (known != loads_.end()) return static_cast<std::size_t>(known - loads_.begin());
  loads_.push_back(std::move(load));
  return loads_.size() - 1;
}

Tools::Load Tools::load_called(const Expression& argument, const Scope& scope) const {
  Load load;
  load.name = meaning_.text_of(argument, scope);
  const auto handed = meaning_.handed_over(argument, scope);
  if (!handed) {
    load.why_not = handed.error();
    return load;
  }
  const auto& [expression, where] = *handed;
  load.name = meaning_.text_of(*expression, *where);
  if (expression->kind == Kind::kName && !meaning_.find(expression->name, *where)) {
    if (expression->name == "load0")
      load.load = StatedLoad{};
    else
      load.note = fmt::format("load {} is not in the files: it is not compared with the cell's",
                              shown(load.name));
    return load;
  }
  const Told<Data> data = named(*expression, *where);
  if (data) load.load = load_of(*data);
  if (!load.load)
    load.why_not =
        fmt::format("load {}: {}", shown(load.name), data ? "it is not constant" : data.error());
  return load;
}

/// `GripLoad lPart;`: beside the tool's own load.
std::size_t Tools::load_set(std::size_t module, const Instruction& instruction) {
  const std::vector<const Scope*> scopes = meaning_.scopes_of(module, instruction.routine);
  if (instruction.arguments.empty()) return 0;
  Load load = load_called(instruction.arguments[0], *scopes[0]);
  for (const Scope* scope : scopes) {
    if (!(load_called(instruction.arguments[0], *scope) == load))
      load.why_not = "GripLoad: its callers decide the load";
  }
  if (load.load && is_placeholder(*load.load)) return 0;
  return known_load(std::move(load));
}

/// The tool with its load: `\TLoad` is the total load; otherwise GripLoad is added to the tool's
/// own.
std::size_t Tools::tool_carrying(std::size_t tool, std::size_t gripped, const Instruction& motion,
                                 const Scope& scope) {
  std::size_t index = gripped;
  for (const Expression& argument : motion.arguments) {
    if (argument.label != "tload") continue;
    Load total = load_called(argument, scope);
    total.total = true;
    if (!total.load || total.load->mass > 0) index = known_load(std::move(total));
  }
  if (index == 0) return tool;
  const auto [entry, is_new] = carrying_.try_emplace({tool, index}, 0);
  if (!is_new) return entry->second;
  const Load& load = loads_[index];
  ProgramTool carrying = program_.tools[tool];
  const std::optional<StatedLoad> own = carrying.load;
  carrying.load = load.load;
  if (load.load && !load.total) carrying.load = together(*load.load, own, carrying.X_FT);
  if (own && carrying.load && own->mass == carrying.load->mass && own->p_F == carrying.load->p_F)
    return entry->second = tool;
  carrying.carries = load.name;
  carrying.load_note = load.note;
  if (carrying.why_not.empty()) carrying.why_not = load.why_not;
  return entry->second = known_tool(std::move(carrying));
}

}  // namespace trammel::cam::rapid
