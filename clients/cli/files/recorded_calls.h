#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/exchange/answer.h"

namespace trammel::cli {

/// Joints of a request to a service, and the recorded answer.
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
  /// Incomplete last lines, which a service leaves while it writes or when it is killed: `a.jsonl
  /// row 7`. Not counted.
  std::vector<std::string> half;
};

/// Calls `take` for each request of the file, or of all files of the folder, in order. An
/// incomplete last line is skipped and reported. Refuses if no line is a record, and names the
/// first file and line.
[[nodiscard]] Result<DamagedLines> read_records(
    const std::string& path, const std::function<Status(const RecordedCall&)>& take);

}  // namespace trammel::cli
