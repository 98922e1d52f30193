#include "clients/programs/model_tools.h"

#include <algorithm>
#include <utility>

#include "server/compensate/model_notes.h"
#include "server/robot/cell_rules.h"
#include "server/robot/joint_pulses.h"

namespace trammel::cam {

CellTools tools_of(const CompensatedModel& model) {
  CellTools cell{model.parts().physics.tools, model.cell().payloads, model.cell().X_WB};
  cell.check_known = [&model](const std::string& tool, const std::string& payload) -> Status {
    TRY(known_tool_and_payload(model, tool, payload));
    return {};
  };
  if (const auto rules = rules_of(model.cell()))
    cell.idle_axes.insert(rules->idle_axes.begin(), rules->idle_axes.end());
  if (cell.X_WB) cell.gravity_B = cell.X_WB->linear().transpose() * model.cell().gravity_W;
  return cell;
}

Result<ToolAndPayload> known_tool_and_payload(const CompensatedModel& model,
                                              const std::string& tool, const std::string& payload) {
  std::string known_tool = TRY(resolve_tool(model.cell(), tool));
  std::string known_payload = TRY(resolve_payload(model.cell(), payload));
  TRY(model.check_trained_with(known_tool, known_payload));
  return ToolAndPayload{std::move(known_tool), std::move(known_payload)};
}

exchange::ModelInfo info_of(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  exchange::ModelInfo info;
  info.cell = model.cell().name;
  info.id = provenance.id;
  info.hash = provenance.hash;
  info.level = provenance.level;
  info.batch_id = provenance.batch_id;
  info.trained_at_unix_s = provenance.trained_at;
  info.measured_at_unix_s = provenance.measured_at;
  info.training_poses = provenance.training_poses;
  info.notes = notes_of(model);
  return info;
}

Result<std::vector<double>> pulses_of_job(const Cell& cell) {
  constexpr std::size_t kAxes = 6;
  std::vector<double> pulses = TRY(joint_pulses(cell));
  if (pulses.size() != kAxes) pulses.clear();
  return pulses;
}

Failure no_motion_in(const std::vector<SourceFile>& files, Dialect dialect,
                     const std::string& where) {
  const bool is_empty = std::all_of(files.begin(), files.end(),
                                    [](const SourceFile& file) { return file.text.empty(); });
  return refused("{}no motion of a {} program in it, expected {}", is_empty ? "it is empty: " : "",
                 name_of(dialect), motions_of(dialect))
      .in(where)
      .next(fmt::format("see that it is the whole program; --format names another kind: {}",
                        dialect_names()));
}

}  // namespace trammel::cam
