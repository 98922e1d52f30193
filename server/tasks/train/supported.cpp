#include "server/tasks/train/supported.h"

#include <algorithm>

#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/compensate/paired_gain.h"
#include "server/measurement/repeats.h"
#include "server/tasks/train/given_up.h"

namespace trammel {

namespace {

/// 3 x N, m: the residuals of `judges` with the sources identified on `train`.
Result<Eigen::Matrix3Xd> left_by(const std::shared_ptr<const Cell>& cell,
                                 const std::vector<std::string>& sources,
                                 const MeasurementBatch& train, const MeasurementBatch& judged_by) {
  const CalibrationResult identified =
      TRY(calibrate(cell, with_unknown_tool(sources, *cell), train, {}));
  const MeasurementBatch judges = aligned(judged_by, identified.sessions, cell->tracker);
  Eigen::Matrix3Xd left(3, static_cast<Eigen::Index>(judges.measurements.size()));
  for (Eigen::Index i = 0; i < left.cols(); ++i) {
    const Measurement& m = judges.measurements[static_cast<std::size_t>(i)];
    left.col(i) = m.p_W - identified.model.pose_W(m.context).translation();
  }
  return left;
}

std::vector<std::string> joined(std::vector<std::string> own,
                                const std::vector<std::string>& found) {
  own.insert(own.end(), found.begin(), found.end());
  return own;
}

}  // namespace

Result<Supported> supported_by(const std::shared_ptr<const Cell>& cell,
                               const std::vector<std::string>& own,
                               const std::vector<std::string>& found, const MeasurementBatch& train,
                               const MeasurementBatch& judges,
                               const std::function<bool(double share)>& progress) {
  const MeasurementBatch merged = merge_repeats(train, cell->tracker.sigma).batch;
  return supported_by({found,
                       [&](const std::vector<std::string>& some) {
                         return left_by(cell, joined(own, some), merged, judges);
                       },
                       [](const std::string&) { return true; }, progress});
}

Result<Supported> supported_by(const SupportQuestion& question) {
  const std::vector<std::string>& found = question.found;
  Supported supported{found, {}};
  auto with = TRY(question.left_by(found));
  while (supported.sources.size() > 1) {
    const auto asked = static_cast<double>(supported.left_out.size());
    Unsupported least;
    std::size_t place = 0;
    Eigen::Matrix3Xd left;
    for (std::size_t k = 0; k < supported.sources.size(); ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(supported.sources.size());
      if (question.progress &&
          !question.progress((asked + share) / static_cast<double>(found.size())))
        return given_up();
      if (!question.may_be_dropped(supported.sources[k])) continue;
      std::vector<std::string> others = supported.sources;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const auto without = question.left_by(others);
      if (!without) continue;  // the rest cannot do without it
      // The score by ranks is not used: it would outvote a cause that acts at a tenth of the poses.
      const double z = paired_gain(*without, with).z_sum;
      if (z > least.z || (z == least.z && !least.source.empty())) continue;
      least = {supported.sources[k], z};
      place = k;
      left = *without;
    }
    if (least.source.empty()) break;
    supported.sources.erase(supported.sources.begin() + static_cast<std::ptrdiff_t>(place));
    supported.left_out.push_back(std::move(least));
    with = std::move(left);
  }
  return supported;
}

std::string to_string(const std::vector<Unsupported>& left_out) {
  std::vector<std::string> sentences;
  for (const Unsupported& one : left_out) {
    sentences.push_back(fmt::format(
        "{} is left out: {} do as well without it (z {:.2f})", in_words(one.source),
        one.another_day ? "poses held out in blocks of time" : "the poses held out", one.z));
  }
  return fmt::format("{}", fmt::join(sentences, "; "));
}

}  // namespace trammel
