#include "server/tasks/train/first_batch.h"

#include <utility>

#include "server/calibrate/batch_check.h"
#include "server/calibrate/jump.h"
#include "server/error_sources/physical_model.h"

namespace trammel {

namespace {

/// The cell with the sources that are asked for; a level that cannot be read is refused by the
/// training.
std::shared_ptr<const Cell> with_sources(const std::shared_ptr<const Cell>& cell,
                                         const std::optional<std::string>& level) {
  if (!level) return cell;
  Result<std::vector<std::string>> names = parse_level(*level);
  if (!names) return cell;
  if (std::erase(*names, kAutoSources) > 0 && names->empty()) return cell;
  auto asked = std::make_shared<Cell>(*cell);
  asked->model.error_sources = std::move(*names);
  return asked;
}

}  // namespace

std::optional<Error> doubt_of_first_batch(const std::shared_ptr<const Cell>& cell,
                                          const CheckedBatch& batch,
                                          const std::optional<std::string>& level) {
  if (auto doubt = batch_doubt(batch.rows(), *cell)) return doubt;
  const auto jump =
      jump_within(with_sources(cell, level), batch.in_order_of_time(cell->robot).rows());
  if (!jump) return std::nullopt;
  return refused(
             "something changed in the middle of it, {}; no single arm fits the poses before and "
             "after",
             in_words(*jump))
      .at_row(jump->row)
      .of("pose_id")
      .with_text(jump->pose_id)
      .next("give the poses before and after as two batches")
      .value();
}

Status check_first_batch(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                         const std::optional<std::string>& level) {
  std::optional<Error> doubt = doubt_of_first_batch(cell, batch, level);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id());
}

}  // namespace trammel
