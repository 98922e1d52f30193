#include "server/tasks/train/successor.h"

#include <set>
#include <utility>

#include "server/error_sources/cause_words.h"
#include "server/tasks/accept/gate.h"

namespace trammel {

namespace {

/// Why `batch` cannot replace all of `present`; empty where it can.
std::string narrower(const ServedModel& present, const CheckedBatch& batch) {
  const CompensatedModel::Parts& parts = present.model.parts();
  std::vector<JointVector> poses;
  std::set<std::pair<std::string, std::string>> used;
  for (const Measurement& m : batch.rows().measurements) {
    poses.push_back(m.context.q);
    used.emplace(m.context.tool, m.context.payload);
  }
  for (const auto& [tool, payload] : parts.trained_with) {
    if (!used.contains({tool, payload}))
      return fmt::format("the batch has no pose with tool '{}' and payload '{}'", tool, payload);
  }
  const double covered = coverage(poses, parts.q_min, parts.q_max);
  if (covered >= GateOptions::kLeastCoverage) return "";
  return fmt::format(
      "the batch spreads over {:.0f} % of the joint ranges of version {} (limit {:.0f} %)",
      100 * covered, present.version, 100 * GateOptions::kLeastCoverage);
}

}  // namespace

Result<Successor> train_successor(const std::shared_ptr<const Cell>& cell,
                                  const CheckedBatch& batch, const ServedModel* present,
                                  TrainOptions options) {
  const std::string why = present == nullptr ? "" : narrower(*present, batch);
  if (why.empty()) {
    return train(cell, batch, options).map([](CompensatedModel model) {
      return Successor{std::move(model), ""};
    });
  }
  options.level.reset();
  options.from = present->model;
  auto refitted = train(cell, batch, options);
  if (!refitted && refitted.error().code == ErrorCode::kRefused) {
    options.refit = {std::string(cause_correcting(causes::Part::kBase).spelling)};
    refitted = train(cell, batch, options);
  }
  if (!refitted) return tl::make_unexpected(refitted.error());
  return Successor{std::move(*refitted),
                   fmt::format("{}: {} refitted, the rest is that of version {}", why,
                               causes_in_words(options.refit), present->version)};
}

}  // namespace trammel
