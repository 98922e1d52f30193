#include "clients/cam/krl/tools.h"

#include <fmt/format.h>

#include <cstdlib>

#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::krl {

/// `;FOLD PTP P1 ... Tool[1]:spindle Base[2]:panel;...`
void Tools::note_tool_name(const Line& line) {
  if (!line.comment.starts_with("FOLD")) return;
  const std::size_t at = line.comment.find("Tool[");
  const std::size_t close =
      line.comment.find("]:", at == std::string_view::npos ? line.comment.size() : at);
  if (at == std::string_view::npos || close == std::string_view::npos) return;
  const std::size_t end = line.comment.find_first_of(" ;,\t\r", close + 2);
  const std::string number(line.comment.substr(at + 5, close - at - 5));
  tool_names_.emplace(number, std::string(line.comment.substr(close + 2, end - close - 2)));
}

std::size_t Tools::add_tool(ProgramTool tool) { return add_once(program_, std::move(tool)); }

std::size_t Tools::add_frame(ProgramFrame frame) { return add_once(program_, std::move(frame)); }

std::size_t Tools::unknown_tool(const std::string& why) {
  ProgramTool tool;
  tool.name = "$TOOL";
  tool.why_not = why;
  return add_tool(std::move(tool));
}

std::size_t Tools::unknown_base(const std::string& why) {
  return add_frame({"$BASE", Pose::Identity(), why});
}

std::size_t Tools::unknown_load(const std::string& why) {
  return add_load({"$LOAD", std::nullopt, "", why});
}

std::size_t Tools::tool_numbered(int number, std::size_t f) {
  if (number == 0) return add_tool({"TOOL_DATA[0]", "", 0, Pose::Identity(), std::nullopt, 0, ""});
  const std::string data = fmt::format("TOOL_DATA[{}]", number);
  ProgramTool tool;
  const auto named = tool_names_.find(std::to_string(number));
  tool.name = named == tool_names_.end() ? data : named->second;
  const bool by_row = take_row(data, options_, tool);
  const Told<const Assigned*> value = names_.value_of(data, f);
  if (value && by_row)
    tool.why_not =
        against_row(data, *tool.X_FT, names_.frame_of((*value)->operands, (*value)->file), **value);
  else if (value)
    fill(**value, tool);
  else if (names_.is_set(data, f))
    tool.why_not = value.error();
  const std::string load = fmt::format("LOAD_DATA[{}]", number);
  if (const Told<const Assigned*> stated = names_.value_of(load, f)) {
    tool.load = load_of((*stated)->operands);
    tool.load_note = note_on_default(tool.load, **stated);
  } else if (names_.is_set(load, f)) {
    tool.load_note = fmt::format("{}: it is not compared with the cell's", stated.error());
  }
  return add_tool(std::move(tool));
}

std::size_t Tools::base_numbered(int number, std::size_t f) {
  if (number == 0) return 1;
  const std::string data = fmt::format("BASE_DATA[{}]", number);
  Value name;
  name.kind = Value::Kind::kName;
  name.name = data;
  return base_set({name}, f);
}

/// `$TOOL = ...`
std::size_t Tools::tool_set(const std::vector<Value>& operands, std::size_t f, std::size_t k) {
  const std::string data =
      operands.size() == 1 && operands[0].kind == Value::Kind::kName ? operands[0].name : "";
  if (data == "$NULLFRAME") return tool_numbered(0, f);
  if (data.starts_with("TOOL_DATA[") && data.find('*') == std::string::npos)
    return tool_numbered(std::atoi(data.c_str() + 10), f);
  ProgramTool tool;
  tool.name = data.empty() ? "$TOOL" : data;
  if (!data.empty() && names_.find(data, f) == nullptr) return add_tool(std::move(tool));
  fill({f, k, operands}, tool);
  return add_tool(std::move(tool));
}

/// `$BASE = ...`
std::size_t Tools::base_set(const std::vector<Value>& operands, std::size_t f) {
  ProgramFrame frame;
  frame.name =
      operands.size() == 1 && operands[0].kind == Value::Kind::kName ? operands[0].name : "$BASE";
  if (std::string why = carried_by(operands, f); !why.empty()) {
    frame.why_not = std::move(why);
    return add_frame(std::move(frame));
  }
  const bool numbered =
      frame.name.starts_with("BASE_DATA[") && frame.name.find('*') == std::string::npos;
  Told<Pose> X_WO = names_.frame_of(operands, f);
  if (numbered && take_row(frame.name, options_, frame)) {
    // Rows are seen from the robot's base.
    if (X_WO) X_WO = names_.robroot().inverse() * *X_WO;
    if (const Told<const Assigned*> value = names_.value_of(frame.name, f))
      frame.why_not = against_row(frame.name, frame.X_BO, X_WO, **value);
    else if (names_.is_set(frame.name, f))
      frame.why_not = fmt::format("base {}: {}", shown(frame.name), value.error());
    return add_frame(std::move(frame));
  }
  if (X_WO) frame.X_BO = *X_WO;
  if (!X_WO) frame.why_not = fmt::format("base {}: {}", shown(frame.name), X_WO.error());
  return add_frame(std::move(frame));
}

std::size_t Tools::add_load(Load load) {
  for (std::size_t k = 0; k < loads_.size(); ++k) {
    if (loads_[k].name == load.name && loads_[k].why_not == load.why_not) return k;
  }
  loads_.push_back(std::move(load));
  return loads_.size() - 1;
}

/// `$LOAD = ...`
std::size_t Tools::load_set(const std::vector<Value>& operands, std::size_t f, std::size_t k) {
  Load load{fmt::format("$LOAD ({})", names_.place(f, k)), std::nullopt, "", ""};
  const Assigned here{f, k, operands};
  const Assigned* value = &here;
  if (operands.size() == 1 && operands[0].kind == Value::Kind::kName) {
    load.name = operands[0].name;
    if (names_.find(root_of(load.name), f) == nullptr) {
      load.note = fmt::format("load {} is not in the files: it is not compared with the cell's",
                              shown(load.name));
      return add_load(std::move(load));
    }
    const Told<const Assigned*> assigned = names_.value_of(load.name, f);
    if (assigned) value = *assigned;
    if (!assigned) load.why_not = "$LOAD: " + assigned.error();
  }
  if (load.why_not.empty()) load.load = load_of(value->operands);
  if (load.load) load.note = note_on_default(load.load, *value);
  if (load.why_not.empty() && !load.load)
    load.why_not = fmt::format("$LOAD is not constant ({})", names_.place(f, k));
  return add_load(std::move(load));
}

/// The tool as a motion has it.
std::size_t Tools::tool_carrying(std::size_t tool, std::size_t index) {
  const Load& load = loads_[index];
  const std::optional<StatedLoad>& own = program_.tools[tool].load;
  const bool same = own && load.load && own->mass == load.load->mass && own->p_F == load.load->p_F;
  if (index == 0 || same) return tool;
  ProgramTool carrying = program_.tools[tool];
  carrying.carries = load.name;
  carrying.load = load.load;
  carrying.load_note = load.note;
  if (carrying.why_not.empty()) carrying.why_not = load.why_not;
  return add_tool(std::move(carrying));
}

/// The reason why a row of --frames contradicts the value in the files; empty if they agree.
std::string Tools::against_row(const std::string& row, const Pose& X, const Told<Pose>& by_files,
                               const Assigned& at) const {
  return by_files ? cam::against_row(row, X, *by_files, names_.place(at.file, at.line))
                  : by_files.error();
}

void Tools::fill(const Assigned& assigned, ProgramTool& tool) const {
  tool.file = program_.files[assigned.file].name;
  tool.line = lines_[assigned.file][assigned.line].number;
  const Told<Pose> X_FT = names_.frame_of(assigned.operands, assigned.file);
  if (!X_FT) {
    tool.why_not = fmt::format("tool {}: {}", shown(tool.name), X_FT.error());
    return;
  }
  tool.X_FT = *X_FT;
  tool.rotation_rounding = from_deg(0.001);
}

std::optional<StatedLoad> Tools::load_of(const std::vector<Value>& operands) {
  if (operands.size() != 1) return std::nullopt;
  const Value* mass = operands[0].field("M");
  const Value* centre = operands[0].field("CM");
  if (mass == nullptr || mass->kind != Value::Kind::kNumber) return std::nullopt;
  if (mass->number < 0) return StatedLoad{mass->number, Vector3::Zero(), false};
  if (centre == nullptr) return std::nullopt;
  StatedLoad load;
  load.mass = mass->number;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Value* number = centre->field(kPose[static_cast<std::size_t>(k)]);
    if (number == nullptr || number->kind != Value::Kind::kNumber) return std::nullopt;
    load.p_F(k) = from_mm(number->number);
  }
  return load;
}

/// `{M -1}` means that the load was never entered.
std::string Tools::note_on_default(const std::optional<StatedLoad>& load,
                                   const Assigned& at) const {
  if (!load || load->mass >= 0) return "";
  return fmt::format(
      "a load of {:g} kg ({}): the controller takes its default load, which is not compared with "
      "the cell's",
      load->mass, names_.place(at.file, at.line));
}

/// True if the number is that of a unit of the controller, or is not known. 0 and less is none, and
/// `MACHINE_DEF[3]={NAME[] "",...,MECH_TYPE #NONE}` does not exist.
bool Tools::is_unit(const Value* index, std::size_t f) const {
  if (index == nullptr) return false;
  if (index->kind != Value::Kind::kNumber) return true;
  if (index->number <= 0) return false;
  const Told<const Assigned*> unit =
      names_.value_of(fmt::format("MACHINE_DEF[{:g}]", index->number), f);
  const Value* type =
      unit && (*unit)->operands.size() == 1 ? (*unit)->operands[0].field("MECH_TYPE") : nullptr;
  return type == nullptr ||
         upper(program_.files[(*unit)->file].text.substr(type->begin, 5)) != "#NONE";
}

/// The reason why a base moves: `MACH_DEF_INDEX[2]=3` or `MACHINE_FRAME_DAT[2]={MACH_DEF_INDEX
/// 3,...}` attaches it to a unit of the controller, anywhere in the files. Empty if it does not.
std::string Tools::carried(int number, std::size_t f) const {
  const std::string plain = fmt::format("MACH_DEF_INDEX[{}]", number),
                    in_list = fmt::format("MACHINE_FRAME_DAT[{}]", number);
  for (const auto& [key, variable] : names_.all()) {
    if (key.second != plain && key.second != in_list) continue;
    for (const Assigned& at : variable.values) {
      if (at.operands.size() != 1) continue;
      const Value* index =
          key.second == plain ? &at.operands[0] : at.operands[0].field("MACH_DEF_INDEX");
      if (is_unit(index, f))
        return fmt::format("external kinematics carry base {} ({}, {})", number,
                           key.second.substr(0, key.second.find('[')),
                           names_.place(at.file, at.line));
    }
  }
  return "";
}

/// The same of an expression: one of its operands is such a base, or a unit's place
/// (`MACHINE_DEF[2].ROOT`), or stands for one.
std::string Tools::carried_by(const std::vector<Value>& operands, std::size_t f, int depth) const {
  constexpr int kDeepest = 20;
  for (const Value& operand : operands) {
    if (operand.kind != Value::Kind::kName || depth > kDeepest) continue;
    const std::string& name = operand.name;
    if (name.starts_with("MACHINE_DEF["))
      return fmt::format("{} is the place of external kinematics", shown(name));
    const bool numbered = name.starts_with("BASE_DATA[") && name.find('*') == std::string::npos;
    std::string why = numbered ? carried(std::atoi(name.c_str() + 10), f) : "";
    if (const Told<const Assigned*> value = names_.value_of(name, f); why.empty() && value)
      why = carried_by((*value)->operands, (*value)->file, depth + 1);
    if (!why.empty()) return why;
  }
  return "";
}

}  // namespace trammel::cam::krl
