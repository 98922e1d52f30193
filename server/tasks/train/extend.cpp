#include "server/tasks/train/extend.h"

#include <algorithm>
#include <set>

#include "server/error_sources/catalogue.h"
#include "server/tasks/accept/verdict.h"
#include "server/tasks/train/lasting_sources.h"

namespace trammel {

namespace {

constexpr double kSupportShare =
    0.25;  // of the progress of an extended model; the rest is its training
constexpr double kExtendedShare = 0.6;  // of an extension's progress; the rest is the model beside
                                        // it

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

/// `options` whose progress is the part [from, to] of the whole.
TrainOptions as_part(TrainOptions options, double from, double to) {
  if (const auto whole = options.progress) {
    options.progress = [whole, from, to](const std::string& stage, double share) {
      return whole(stage, from + (to - from) * share);
    };
  }
  return options;
}

/// Trains on a batch that the diagnosis has examined. A training would refuse another tool, which
/// may be the finding itself.
Result<CompensatedModel> trained(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                                 const std::vector<std::string>& sources, TrainOptions options) {
  options.looked_at = true;
  options.level = level_of(sources);
  return train(cell, batch, options);
}

std::vector<std::string> joined(std::vector<std::string> own,
                                const std::vector<std::string>& found) {
  own.insert(own.end(), found.begin(), found.end());
  return own;
}

std::set<int> suspected_rows(const Diagnosis& diagnosis) {
  std::set<int> rows;
  for (const SuspectedPose& pose : diagnosis.suspects) rows.insert(pose.row);
  return rows;
}

/// True for the base, which is located anew on another day.
bool is_of_the_base(const std::string& source) {
  const CauseRecord* cause = find_cause(source);
  return cause != nullptr && cause->part == causes::Part::kBase;
}

/// Removes causes from `supported` that another day does not need, and measures the gain of the
/// others there. Causes that belong to the batch alone, and the base, are not tested.
std::optional<DayGain> carry(const std::shared_ptr<const Cell>& cell,
                             const std::vector<std::string>& own, const CheckedBatch& batch,
                             const Diagnosis& diagnosis, Supported& supported) {
  if (std::all_of(supported.sources.begin(), supported.sources.end(), is_of_the_base))
    return std::nullopt;
  const auto day = AnotherDay::make(cell, batch.rows(), joined(own, supported.sources),
                                    suspected_rows(diagnosis));
  if (!day) return std::nullopt;
  auto carried = supported_by(
      {supported.sources,
       [&](const std::vector<std::string>& some) { return day->left_by(joined(own, some)); },
       [](const std::string& source) {
         return !is_of_the_base(source) && !lasting_sources({source}).empty();
       },
       {}});
  if (!carried) return std::nullopt;
  for (Unsupported& one : carried->left_out) one.another_day = true;
  supported.sources = carried->sources;
  supported.left_out.insert(supported.left_out.end(), carried->left_out.begin(),
                            carried->left_out.end());
  const auto before = day->left_by(own);
  const auto after = day->left_by(joined(own, supported.sources));
  if (!before || !after) return std::nullopt;
  DayGain gain = day_gain(*before, *after);
  gain.blocks = day->blocks();
  return gain;
}

}  // namespace

Status check_can_extend(const Diagnosis& diagnosis) {
  if (diagnosis.sources_after != diagnosis.sources_before) return {};
  return refused("no cause was named that the model could be extended by ({}): {}",
                 to_string(diagnosis.verdict), diagnosis.sentence);
}

std::vector<std::string> added_sources(const std::vector<std::string>& own,
                                       const Diagnosis& diagnosis) {
  std::vector<std::string> added;
  std::copy_if(diagnosis.sources_after.begin(), diagnosis.sources_after.end(),
               std::back_inserter(added), [&](const std::string& source) {
                 // Another form of a source that the cell has, such as the compliance; training
                 // chooses the form again.
                 const bool form = as_listed(source, own) != source;
                 return !form && !contains(diagnosis.sources_before, source) &&
                        !contains(own, source);
               });
  return added;
}

Result<ExtendedModel> extended_model(const std::shared_ptr<const Cell>& cell,
                                     const std::vector<std::string>& own, const CheckedBatch& batch,
                                     const Diagnosis& diagnosis, const TrainOptions& options) {
  if (const Status allowed = check_can_extend(diagnosis); !allowed)
    return Failure(allowed.error()).in("batch " + diagnosis.batch.id);
  if (batch.held_out().measurements.empty())
    return refused("no rows are held out to judge an extended model by")
        .in("batch " + batch.id())
        .of("set")
        .beyond(0, 1);
  Supported supported = TRY(supported_by(
      cell, own, added_sources(own, diagnosis), batch.training(),
      judges_of(diagnosis, batch.held_out()).batch, [&options](double share) {
        return !options.progress ||
               options.progress("asking of each cause what it is worth", kSupportShare * share);
      }));
  std::optional<DayGain> day = carry(cell, own, batch, diagnosis, supported);
  std::vector<std::string> sources = joined(own, supported.sources);
  auto model = TRY(trained(cell, batch, sources, as_part(options, kSupportShare, 1)));
  return ExtendedModel{std::move(model), std::move(sources), std::move(supported.left_out),
                       std::move(day)};
}

Judges judges_of(const Diagnosis& diagnosis, MeasurementBatch held_out) {
  constexpr double kMostLeftOut = 0.1;
  std::set<int> rows;
  for (const SuspectedPose& pose : diagnosis.suspects) {
    if (pose.held_out) rows.insert(pose.row);
  }
  Judges judges{std::move(held_out), {}};
  auto& all = judges.batch.measurements;
  if (static_cast<double>(rows.size()) > kMostLeftOut * static_cast<double>(all.size()))
    return judges;
  std::erase_if(all, [&](const Measurement& m) {
    if (!rows.contains(m.row)) return false;
    judges.left_out.push_back(m.pose_id);
    return true;
  });
  return judges;
}

Result<Extension> extend(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                         const Diagnosis& diagnosis, const TrainOptions& options) {
  const std::vector<std::string>& own = cell->model.error_sources;
  auto after =
      TRY(extended_model(cell, own, batch, diagnosis, as_part(options, 0, kExtendedShare)));
  auto before = TRY(trained(cell, batch, own, as_part(options, kExtendedShare, 1)));
  Judges judges = judges_of(diagnosis, batch.held_out());
  PairedGain gain = paired_gain(before, after.model, judges.batch);
  gain.left_out = std::move(judges.left_out);
  JudgingSession session{batch.id(), batch.training(), std::move(judges.batch)};
  const ServedModel present(cell->name, 0, before);
  GateVerdict verdict = verdict_on(after.model, &present, {}, std::nullopt, {session},
                                   {.bar = Bar::kBetterBeyondChance});
  std::vector<std::string> lasting = lasting_sources(after.sources);
  return Extension{std::move(after.sources), std::move(lasting),        std::move(before),
                   std::move(after.model),   std::move(gain),           std::move(session),
                   std::move(verdict),       std::move(after.left_out), std::move(after.day)};
}

Result<Applied> applied(const std::shared_ptr<const Cell>& cell, const CheckedBatch& batch,
                        const Diagnosis& diagnosis, const TrainOptions& options) {
  if (const Status possible = check_can_extend(diagnosis); !possible)
    return Applied{{}, sentence(possible.error())};
  return extend(cell, batch, diagnosis, options).map([](Extension extension) {
    std::string why_not = extension.why_not();
    return Applied{std::move(extension), std::move(why_not)};
  });
}

std::string Extension::why_not() const {
  if (day && !day->carries()) return to_string(*day);
  return verdict.put_in_force ? "" : verdict.why;
}

HoldOut held_out_to_extend(std::uint64_t seed) {
  return held_out_by_service(kUsualJudgingShare, seed);
}

Error with_rows_set_aside(Error error, const CheckedBatch& batch) {
  const std::size_t aside = batch.held_out().measurements.size();
  if (error.code == ErrorCode::kRefused && aside > 0)
    error.message += fmt::format(" ({} of {} rows are set aside to judge by)", aside, batch.size());
  return error;
}

}  // namespace trammel
