#pragma once

#include <map>
#include <string>
#include <vector>

#include "clients/cam/correct_program.h"
#include "server/compensate/served_model.h"
#include "server/dds/gateway/service_calls.h"

namespace trammel {

/// A robot program to correct, as it came.
struct SentProgram {
  std::vector<cam::SourceFile> files;  ///< the bytes, in whatever encoding
  std::string format;                  ///< of --format; empty: by the ending of the first name
  std::string tool, payload;           ///< of the cell; empty: as the program says
  bool keep_digits = false;
  std::string frames;  ///< the table of given_poses.h; empty: none
};

struct ReturnedProgram {
  cam::CorrectedProgram corrected;
  std::vector<std::string> files;  ///< the bytes of each; all that is no corrected number is kept
};

/// Corrects a program by the model `served`: the service answers for its targets, and refuses once
/// another model is in force. Refuses the same as `trammel correct`. `version`: of this software.
[[nodiscard]] Result<ReturnedProgram> correct_sent_program(
    ServiceCalls& calls, const CallFrom& from, const ServedModel& served, SentProgram program,
    const std::string& version, CallOutcome& outcome);

}  // namespace trammel
