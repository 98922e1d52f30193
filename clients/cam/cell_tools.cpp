#include "clients/cam/cell_tools.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

double distance(const Pose& a, const Pose& b) { return (a.translation() - b.translation()).norm(); }
double angle(const Pose& a, const Pose& b) { return pose_difference(a, b).tail<3>().norm(); }

bool same_tool(const ProgramTool& tool, const Pose& X_FT) {
  return distance(*tool.X_FT, X_FT) <= kToolPositionTolerance &&
         angle(*tool.X_FT, X_FT) <=
             kToolRotationTolerance + std::min(tool.rotation_rounding, from_deg(0.02));
}

std::string difference_text(const ProgramTool& tool, const std::string& name, const Pose& X_FT) {
  return fmt::format("tool {} is {} in the {}, {} is {} in the cell: {}", shown(tool.name),
                     pose_text(*tool.X_FT), tool.from_row ? "row of --frames" : "program", name,
                     pose_text(X_FT), apart_text(*tool.X_FT, X_FT));
}

bool same_load(const StatedLoad& load, const Payload& payload) {
  return std::abs(load.mass - payload.mass) <= std::max(0.1, kLoadMassTolerance * payload.mass) &&
         (!load.has_centre || (load.p_F - payload.p_FoCog_F).norm() <= kLoadCentreTolerance);
}

std::string load_text(double mass, const Vector3& p_F) {
  const Vector3 p = p_F * to_mm(1);
  return fmt::format("{:.3f} kg at [{:.1f}, {:.1f}, {:.1f}] mm", mass, p.x(), p.y(), p.z());
}

std::string load_difference(const ProgramTool& tool, const std::string& name,
                            const Payload& payload) {
  const StatedLoad& load = *tool.load;
  const std::string in_cell =
      fmt::format("payload {} is {} in the cell", name, load_text(payload.mass, payload.p_FoCog_F));
  const double mass = std::abs(load.mass - payload.mass);
  if (!load.has_centre)
    return fmt::format("load of tool {} is {:.3f} kg in the program, {}: {:.3f} kg apart",
                       called(tool), load.mass, in_cell, mass);
  return fmt::format("load of tool {} is {} in the program, {}: {:.3f} kg and {:.1f} mm apart",
                     called(tool), load_text(load.mass, load.p_F), in_cell, mass,
                     to_mm((load.p_F - payload.p_FoCog_F).norm()));
}

/// The tool of the cell with the name of the program's tool, ignoring case.
std::map<std::string, Pose>::const_iterator named(const CellTools& cell, const std::string& name) {
  return std::find_if(cell.tools.begin(), cell.tools.end(),
                      [&](const auto& tool) { return lower(tool.first) == lower(name); });
}

class Choosing {
 public:
  Choosing(const Program& program, const CellTools& cell, const std::string& tool,
           const std::string& payload)
      : program_(program), cell_(cell), asked_(tool), payload_(payload) {}

  Result<std::vector<ToolChoice>> choose(const std::vector<ToolUse>& uses) {
    std::vector<ToolChoice> choices(program_.tools.size());
    bool any = false;
    for (std::size_t k = 0; k < choices.size(); ++k) {
      if (uses[k] == ToolUse::kNone) continue;
      choices[k] = uses[k] == ToolUse::kJoints ? choice_of_the_cell(program_.tools[k])
                                               : choice(program_.tools[k]);
      if (choices[k].why_not.empty()) choose_payload(program_.tools[k], choices[k]);
      if (choices[k].why_not.empty() && cell_.check_known) {
        const Status known = cell_.check_known(choices[k].tool, choices[k].payload);
        if (!known) choices[k].why_not = sentence(known.error());
      }
      any |= choices[k].why_not.empty();
    }
    // If no tool belongs to the cell, the program does not belong to the cell.
    for (std::size_t k = 0; k < choices.size() && !any; ++k) {
      if (uses[k] != ToolUse::kNone && (program_.tools[k].X_FT || program_.tools[k].load))
        refuse(program_.tools[k], choices[k].why_not);
    }
    if (!refusals_.empty()) return tl::make_unexpected(together(std::move(refusals_)));
    return choices;
  }

 private:
  void refuse(const ProgramTool& tool, const std::string& what) {
    Error error = refused("{}", what).of("tool " + shown(tool.name)).value();
    if (tool.from_row) {
      error.file = "--frames";
      error.field = tool.row;
    } else if (!tool.file.empty()) {
      error.file = tool.file;
      if (tool.line > 0) error.row = tool.line;
    }
    refusals_.push_back(std::move(error));
  }

  /// The requested tool, or the cell's only one; otherwise the one that the program means.
  ToolChoice choice_of_the_cell(const ProgramTool& tool) {
    const auto asked = cell_.tools.find(asked_);
    const bool only = asked_.empty() && cell_.tools.size() == 1;
    if (asked == cell_.tools.end() && !only) return choice(tool);
    ToolChoice choice;
    choice.tool = only ? cell_.tools.begin()->first : asked->first;
    if (!tool.X_FT || !same_tool(tool, cell_.tools.at(choice.tool)))
      choice.note =
          fmt::format("motions of the axes with tool {}: where {} of the cell goes is told",
                      called(tool), choice.tool);
    return choice;
  }

  ToolChoice choice(const ProgramTool& tool) {
    ToolChoice choice;
    // A table does not name its tool: it is the cell's only one, if the cell has exactly one.
    if (tool.name.empty() && asked_.empty() && cell_.tools.size() == 1) {
      choice.tool = cell_.tools.begin()->first;
      return choice;
    }
    const auto by_name = asked_.empty() ? named(cell_, tool.name) : cell_.tools.find(asked_);
    if (by_name != cell_.tools.end()) {
      choice.tool = by_name->first;
      if (!tool.X_FT) {
        choice.note = fmt::format(
            "tool {} is not in the files: it is taken for {} of the cell without comparing them",
            shown(tool.name), by_name->first);
      } else if (!same_tool(tool, by_name->second)) {
        // --tool may mean another tool of the program, but not one of the same name.
        choice.why_not = difference_text(tool, by_name->first, by_name->second);
        if (lower(by_name->first) == lower(tool.name)) refuse(tool, choice.why_not);
      }
      return choice;
    }
    if (!tool.X_FT) {
      choice.why_not = fmt::format("tool {} is neither in the files handed over nor in the cell",
                                   shown(tool.name));
      return choice;
    }
    for (const auto& [name, X_FT] : cell_.tools) {
      if (same_tool(tool, X_FT)) choice.tool = name;
    }
    if (choice.tool.empty()) choice.why_not = nearest(tool);
    return choice;
  }

  std::string nearest(const ProgramTool& tool) const {
    const auto closest =
        std::min_element(cell_.tools.begin(), cell_.tools.end(), [&](const auto& a, const auto& b) {
          return distance(*tool.X_FT, a.second) < distance(*tool.X_FT, b.second);
        });
    if (closest == cell_.tools.end()) return "the cell has no tools";
    return difference_text(tool, closest->first, closest->second);
  }

  void choose_payload(const ProgramTool& tool, ToolChoice& choice) {
    choice.payload = payload_;
    const bool stated = tool.load && !is_placeholder(*tool.load);
    const auto find_by_load = [&] {
      for (const auto& [name, payload] : cell_.payloads) {
        if (same_load(*tool.load, payload)) choice.payload = name;
      }
    };
    if (choice.payload.empty() && stated && !tool.carries.empty()) find_by_load();
    if (choice.payload.empty() && cell_.payloads.size() == 1)
      choice.payload = cell_.payloads.begin()->first;
    if (choice.payload.empty() && cell_.payloads.contains(choice.tool))
      choice.payload = choice.tool;
    if (choice.payload.empty() && stated) find_by_load();
    const auto known = cell_.payloads.find(choice.payload);
    choice.load_note = tool.load_note;
    if (stated && known == cell_.payloads.end())
      choice.load_note = fmt::format(
          "load of tool {} is {} in the program, {}: it is not compared", called(tool),
          tool.load->has_centre ? load_text(tool.load->mass, tool.load->p_F)
                                : fmt::format("{:.3f} kg", tool.load->mass),
          cell_.payloads.empty() ? "the cell has no payloads" : "none of the cell's payloads");
    if (!stated || known == cell_.payloads.end() || same_load(*tool.load, known->second)) return;
    const std::string why = load_difference(tool, known->first, known->second);
    // A load that the program carries only for a while concerns that part only.
    if (tool.carries.empty())
      refuse(tool, why);
    else
      choice.why_not = why;
  }

  const Program& program_;
  const CellTools& cell_;
  const std::string asked_, payload_;
  std::vector<Error> refusals_;
};

}  // namespace

bool is_placeholder(const StatedLoad& load) {
  return load.mass <= 0 || (load.mass <= 1 && load.p_F.norm() <= 1e-3 + 1e-9);
}

Result<std::vector<ToolChoice>> choose_tools(const Program& program,
                                             const std::vector<ToolUse>& uses,
                                             const CellTools& cell, const std::string& tool,
                                             const std::string& payload) {
  if (!tool.empty() && !cell.tools.contains(tool)) {
    std::vector<std::string> known;
    for (const auto& [name, X_FT] : cell.tools) known.push_back(name);
    return failure(ErrorCode::kUsage, "the cell has no tool '{}'", shown(tool))
        .of("--tool")
        .with_text(tool)
        .next(fmt::format("it has: {}", fmt::join(known, ", ")));
  }
  return Choosing(program, cell, tool, payload).choose(uses);
}

}  // namespace trammel::cam
