#include "clients/cam/fanuc/controller.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::fanuc {

namespace {

std::string why_not_by_row(const std::string& row, const Pose& X, const Told& told,
                           const Pose& X_BW) {
  if (!told.X) return told.by_program ? told.why : "";
  return against_row(row, X, X_BW * *told.X, told.where);
}

}  // namespace

void Controller::note_register(const Assignment& assignment, const std::string& where,
                               std::size_t file) {
  const std::string& name = assignment.name;
  Register& set = registers[name];
  const bool element = assignment.target[3].is(",") && assignment.target[4].is_number();
  const std::optional<double> now = assignment.constant;
  const int index = element ? static_cast<int>(value_in(assignment.target[4])) : 0;
  if (!element || !now || index < 1 || index > 6) {
    set.changed = fmt::format("{} is set at run time ({})", name, where);
    return;
  }
  std::optional<double>& value = set.elements[static_cast<std::size_t>(index - 1)];
  const auto took_it = [&](const auto& one) {
    return one.second.from == name && one.second.file == file;
  };
  if (!value && std::any_of(settings.begin(), settings.end(), took_it))
    set.changed = fmt::format("{} is set behind where it is taken ({})", name, where);
  if (value && *value != *now)
    set.changed = fmt::format("{} is set several times ({})", name, where);
  value = now;
}

/// `UFRAME[R[1]]=PR[2]` sets any of them.
const Setting* Controller::setting_of(const std::string& name) const {
  const auto any = settings.find(name.substr(0, name.find('[')) + "[*]");
  const auto own = settings.find(name);
  if (any != settings.end()) return &any->second;
  return own == settings.end() ? nullptr : &own->second;
}

const Register* Controller::register_of(const std::string& name) const {
  const auto any = registers.find("PR[*]");
  const auto own = registers.find(name);
  if (any != registers.end()) return &any->second;
  return own == registers.end() ? nullptr : &own->second;
}

Told Controller::setting(const std::string& name) {
  const Setting* set = setting_of(name);
  if (set == nullptr) return by_system(name);
  if (!set->changed.empty()) return {{}, set->changed, true, ""};
  const Register* from = register_of(set->from);
  std::vector<double> numbers;
  for (std::size_t k = 0; from != nullptr && from->changed.empty() && k < 6; ++k) {
    if (from->elements[k]) numbers.push_back(*from->elements[k]);
  }
  if (numbers.size() == 6) return {pose_of(Coordinates::kAnglesXyz, numbers), "", true, set->where};
  const std::string why = fmt::format(
      "{} comes from {}, whose value is not constant in the program", name, shown(set->from));
  // A row of --frames may give the value of a register that no file has.
  const bool open = from == nullptr && set->from.starts_with("PR[") && !set->from.ends_with("[*]");
  return {{}, why, !open, ""};
}

/// A value of the controller's system variables.
Told Controller::by_system(const std::string& name) {
  const ListedValue* listed = system.take(name);
  if (listed == nullptr)
    return {{},
            fmt::format("{} is not in the files handed over: --frames tells its value", name),
            false,
            ""};
  if (!listed->why_not.empty()) return {{}, listed->why_not, true, ""};
  return {listed->X,    "",          true, fmt::format("{} line {}", listed->file, listed->line),
          listed->file, listed->line};
}

ProgramFrame Controller::frame_of(const std::string& number_text, const ReadOptions& options) {
  ProgramFrame frame;
  frame.name = fmt::format("UFRAME[{}]", number_text);
  if (number_text == "0") return frame;
  const Told told = setting(frame.name);
  if (take_row(frame.name, options, frame)) {
    const auto stands = options.frames.find(kRobotBase);
    const Pose X_BW = stands == options.frames.end() ? Pose::Identity() : stands->second.inverse();
    frame.why_not = why_not_by_row(frame.name, frame.X_BO, told, X_BW);
  } else if (told.X) {
    frame.X_BO = *told.X;
  } else {
    frame.why_not = told.why;
  }
  return frame;
}

ProgramTool Controller::tool_of(const std::string& number_text, const ReadOptions& options,
                                const std::string& file) {
  ProgramTool tool;
  tool.name = fmt::format("UTOOL[{}]", number_text);
  if (number_text == "0") {
    tool.X_FT = Pose::Identity();
    return tool;
  }
  const Told told = setting(tool.name);
  if (take_row(tool.name, options, tool)) {
    tool.why_not = why_not_by_row(tool.name, *tool.X_FT, told, Pose::Identity());
  } else if (told.X) {
    tool.X_FT = *told.X;
    tool.file = told.file.empty() ? file : told.file;
    tool.line = told.line;
  } else if (told.by_program) {
    tool.why_not = told.why;
  }
  if (tool.X_FT) tool.rotation_rounding = from_deg(0.001);
  return tool;
}

}  // namespace trammel::cam::fanuc
