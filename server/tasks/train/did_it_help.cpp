#include "server/tasks/train/did_it_help.h"

#include "server/measurement/gauges.h"
#include "server/tasks/accept/fits_cell.h"
#include "server/tasks/train/train.h"

namespace trammel {

namespace {

/// The model's error sources except those that begin at a pose of its own batch.
std::string lasting_level(const CompensatedModel& model) {
  std::string level;
  for (const ErrorSourcePtr& source : model.parts().physics.sources)
    if (source->cause().lasting == causes::Lasting::kAlways)
      level += (level.empty() ? "" : ",") + source->name();
  return level;
}

}  // namespace

Result<AfterRepair> did_it_help(const CompensatedModel& before,
                                const std::shared_ptr<const Cell>& cell,
                                const CheckedBatch& batch) {
  TRY(check_fits_cell(before, *cell, "model " + before.provenance().id));
  TRY(require_positions(batch.rows(), "diagnose --since"));
  TrainOptions options;
  options.level = lasting_level(before);
  options.bias = "none";
  const CompensatedModel now = TRY(train(cell, batch, options));
  std::vector<PoseContext> poses;
  for (const Measurement& m : positions_of(batch.rows()).measurements) {
    TRY(before.check_trained_with(m.context.tool, m.context.payload));
    poses.push_back(m.context);
  }
  return after_repair(before, now, poses);
}

}  // namespace trammel
