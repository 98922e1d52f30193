#include "clients/cli/service/model_answers.h"

namespace trammel::cli {

cam::CellTools tools_of(const CompensatedModel& model) { return {model.parts().physics.tools, model.cell().payloads}; }

client::ModelInfo info_of(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  client::ModelInfo info;
  info.cell = model.cell().name;
  info.id = provenance.id;
  info.hash = provenance.hash;
  info.level = provenance.level;
  info.batch_id = provenance.batch_id;
  info.trained_at_unix_s = provenance.trained_at;
  info.measured_at_unix_s = provenance.measured_at;
  info.training_poses = provenance.training_poses;
  return info;
}

}  // namespace trammel::cli
