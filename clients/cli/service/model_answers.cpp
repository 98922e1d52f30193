#include "clients/cli/service/model_answers.h"

#include <filesystem>

#include "server/compensate/model_notes.h"
#include "server/robot/cell_rules.h"

namespace trammel::cli {

cam::CellTools tools_of(const CompensatedModel& model) {
  cam::CellTools cell{model.parts().physics.tools, model.cell().payloads, model.cell().X_WB};
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

Result<CompensatedModel> model_named(const std::string& name, const ServiceOptions& service) {
  std::error_code error;
  if (!service.service || std::filesystem::exists(name, error)) return load_model(name);
  const ModelReference reference = TRY(parse_model_reference(name));
  const auto session = TRY(open_session(service));
  const std::string text = TRY(session->export_model(reference.cell, reference.version));
  return deserialize(text, "the service's model " + name);
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

}  // namespace trammel::cli
