#include "server/tasks/train/told_by_training.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "server/error_sources/physical_model.h"
#include "server/measurement/unread_columns.h"
#include "server/robot/cell_rules.h"

namespace trammel {

namespace {

/// The jump in the middle of the batch that remains beside everything in the model.
std::optional<Jump> jump_beside(const CompensatedModel& model, const CheckedBatch& batch) {
  auto cell = std::make_shared<Cell>(*model.parts().physics.cell);
  cell->model.error_sources.clear();
  for (const ErrorSourcePtr& source : model.parts().physics.sources)
    cell->model.error_sources.push_back(source->name());
  return jump_within(cell, batch.in_order_of_time(cell->robot).rows());
}

}  // namespace

std::vector<Note> ToldByTraining::notes() const {
  std::vector<Note> notes;
  if (jump) {
    notes.push_back(
        {"changed_within_batch", Note::Severity::kWarning,
         fmt::format("something changed in the middle of the batch, {}; no single arm fits the "
                     "poses before and after",
                     in_words(*jump))});
  }
  for (const Unlike& one : unlike)
    notes.push_back(
        {"unlike_twins", Note::Severity::kWarning, "unlike its twins: " + to_string(one)});
  return notes;
}

std::vector<Note> ToldByTraining::beside(std::vector<Note> of_model) const {
  for (const Note& note : notes()) of_model.push_back(note);
  if (!unread.empty()) of_model.push_back({"columns_not_read", Note::Severity::kInfo, unread});
  return gravest_first(std::move(of_model));
}

ToldByTraining told_by_training(const CompensatedModel& model, const CheckedBatch& batch,
                                const TrainOptions& options) {
  ToldByTraining told;
  told.unread = unread_columns(batch.rows());
  if (options.looked_at && !options.from) told.jump = jump_beside(model, batch);
  if (options.fleet) told.unlike = unlike_twins(model.parts(), *options.fleet);
  return told;
}

Result<std::optional<FleetPrior>> prior_of_twins(const Cell& cell,
                                                 const std::vector<FleetMember>& twins) {
  const CellRules rules = TRY(rules_of(cell));
  if (!rules.fleet_prior && twins.empty()) return std::optional<FleetPrior>();
  if (twins.empty()) {
    return failure(ErrorCode::kUsage,
                   "cell {} says prior: fleet, and no robot of its type is named", cell.name)
        .of("fleet")
        .next("name the models of its twins: --fleet once for each, `fleet` in a program");
  }
  return learn_fleet_prior(cell.robot, twins).map([](FleetPrior prior) {
    return std::optional(std::move(prior));
  });
}

}  // namespace trammel
