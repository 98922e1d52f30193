#include "server/trainer/pipeline/extend.h"

#include <algorithm>
#include <set>

#include "server/measurement/velocity.h"

namespace trammel {

namespace {

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

constexpr double kSupportShare = 0.2;  // of the progress, the rest is two trainings

/// One of two trainings: its progress is half of theirs.
Result<CompensatedModel> trained(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                                 const std::vector<std::string>& sources, double done, TrainOptions options) {
  options.level = level_of(sources);
  if (const auto whole = options.progress) {
    options.progress = [whole, done](const std::string& stage, double share) {
      return whole(stage, kSupportShare + (1 - kSupportShare) * (done + share / 2));
    };
  }
  return train(cell, batch, options);
}

/// The rows to judge by, of `batch` checked against the cell; refuses where there are none.
Result<BatchSplit> split_to_judge(const Cell& cell, const MeasurementBatch& batch, std::uint64_t seed) {
  Result<MeasurementBatch> checked = check_against_cell(batch, cell);
  if (!checked) return tl::make_unexpected(checked.error());
  fill_velocity(*checked);
  BatchSplit split = split_batch(*checked, 0, seed);
  if (split.validation.measurements.empty())
    return refused("batch {}: no rows are held out to judge an extended model by", batch.id);
  return split;
}

}  // namespace

Status check_can_extend(const Diagnosis& diagnosis) {
  if (diagnosis.sources_after != diagnosis.sources_before) return {};
  return refused("batch {}: no cause was named that the model could be extended by ({}): {}", diagnosis.batch.id,
                 to_string(diagnosis.verdict), diagnosis.sentence);
}

std::vector<std::string> lasting_sources(const std::vector<std::string>& sources) {
  std::vector<std::string> lasting;
  std::copy_if(sources.begin(), sources.end(), std::back_inserter(lasting), [](const std::string& source) {
    const CauseRecord* cause = find_cause(source);
    return cause == nullptr || cause->lasting == causes::Lasting::kAlways;
  });
  return lasting;
}

std::vector<std::string> added_sources(const Cell& cell, const Diagnosis& diagnosis) {
  std::vector<std::string> added;
  std::copy_if(diagnosis.sources_after.begin(), diagnosis.sources_after.end(), std::back_inserter(added),
               [&](const std::string& source) {
                 // Another form of what the cell has already, such as the compliance: training chooses it again.
                 const bool form = as_listed(source, cell.model.error_sources) != source;
                 return !form && !contains(diagnosis.sources_before, source) &&
                        !contains(cell.model.error_sources, source);
               });
  return added;
}

std::vector<std::string> sources_in_force(const CompensatedModel& model, const Cell& cell,
                                          const MeasurementBatch& batch) {
  std::vector<std::string> sources;
  for (const ErrorSourcePtr& source : model.parts().physics.sources) {
    sources.push_back(as_listed(source->name(), cell.model.error_sources));
  }
  return model.provenance().batch_hash == batch_hash(batch) ? sources : lasting_sources(sources);
}

MeasurementBatch with_held_out(MeasurementBatch batch, double share, std::uint64_t seed) {
  std::set<int> held_out;
  for (const Measurement& m : split_batch(batch, share, seed).validation.measurements) held_out.insert(m.row);
  for (Measurement& m : batch.measurements) {
    m.set = held_out.contains(m.row) ? MeasurementSet::kValidation : MeasurementSet::kTrain;
  }
  return batch;
}

Error with_rows_set_aside(Error error, const MeasurementBatch& batch) {
  const auto aside = std::count_if(batch.measurements.begin(), batch.measurements.end(),
                                   [](const Measurement& m) { return m.set == MeasurementSet::kValidation; });
  if (error.code == ErrorCode::kRefused && aside > 0)
    error.message += fmt::format(" ({} of {} rows are set aside to judge by)", aside, batch.measurements.size());
  return error;
}

Judges judges_of(const Diagnosis& diagnosis, MeasurementBatch held_out) {
  constexpr double kMostLeftOut = 0.1;
  std::set<int> rows;
  for (const SuspectedPose& pose : diagnosis.suspects) {
    if (pose.held_out) rows.insert(pose.row);
  }
  Judges judges{std::move(held_out), {}};
  auto& all = judges.batch.measurements;
  if (static_cast<double>(rows.size()) > kMostLeftOut * static_cast<double>(all.size())) return judges;
  std::erase_if(all, [&](const Measurement& m) {
    if (!rows.contains(m.row)) return false;
    judges.left_out.push_back(m.pose_id);
    return true;
  });
  return judges;
}

Result<Supported> supported_sources(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                                    const Diagnosis& diagnosis, std::uint64_t seed,
                                    const std::function<bool(double share)>& progress) {
  const Result<BatchSplit> split = split_to_judge(*cell, batch, seed);
  if (!split) return tl::make_unexpected(split.error());
  return supported_by(cell, cell->model.error_sources, added_sources(*cell, diagnosis), split->train,
                      judges_of(diagnosis, split->validation).batch, progress);
}

Result<Extension> extend(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                         const Diagnosis& diagnosis, TrainOptions options) {
  if (const Status allowed = check_can_extend(diagnosis); !allowed) return tl::make_unexpected(allowed.error());
  Result<Supported> supported = supported_sources(cell, batch, diagnosis, options.seed, [&options](double share) {
    return !options.progress || options.progress("asking of each cause what it is worth", kSupportShare * share);
  });
  if (!supported) return tl::make_unexpected(supported.error());
  std::vector<std::string> sources = cell->model.error_sources;
  sources.insert(sources.end(), supported->sources.begin(), supported->sources.end());
  auto before = trained(cell, batch, cell->model.error_sources, 0, options);
  if (!before) return tl::make_unexpected(before.error());
  auto after = trained(cell, batch, sources, 0.5, options);
  if (!after) return tl::make_unexpected(after.error());
  const Result<BatchSplit> split = split_to_judge(*cell, batch, options.seed);
  if (!split) return tl::make_unexpected(split.error());
  Judges judges = judges_of(diagnosis, split->validation);
  PairedGain gain = paired_gain(*before, *after, judges.batch);
  gain.left_out = std::move(judges.left_out);
  return Extension{sources, lasting_sources(sources),      std::move(*before), std::move(*after),
                   gain,    std::move(supported->left_out)};
}

}  // namespace trammel
