#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"

namespace trammel::cli {

/// Joints that a service was asked about, and what it answered, as far as that is recorded.
struct RecordedPose {
  exchange::AskedJoints asked;
  exchange::Prediction answer;
};

/// A target that a service was asked about, and likewise.
struct RecordedTarget {
  exchange::AskedTarget asked;
  exchange::CorrectedTarget answer;          ///< without its joints
  std::vector<double> commanded_joints_rad;  ///< of a rail mm
};

/// One request that a service has recorded (server/dds/records/README.md). Either poses or targets.
struct RecordedCall {
  std::string file;
  long line = 0;
  std::string trace, cell, tool, payload;
  std::string model_id, model_hash;
  int model_version = 0;
  std::int64_t at_unix_s = 0;
  std::vector<RecordedPose> poses;
  std::vector<RecordedTarget> targets;
};

/// Lines that are no record, as a power cut leaves them.
struct DamagedLines {
  std::size_t count = 0;
  Error first;  ///< with file and line
  /// Last lines without an end, as a service leaves one that is writing or was killed: `a.jsonl row
  /// 7`. Not counted.
  std::vector<std::string> half;
};

/// Calls `take` for each request of the file, or of all files of the folder, in their order. A last
/// line that was not written to its end is left out and told. Refuses where no line is a record,
/// with the first file and line.
[[nodiscard]] Result<DamagedLines> read_records(
    const std::string& path, const std::function<Status(const RecordedCall&)>& take);

}  // namespace trammel::cli
