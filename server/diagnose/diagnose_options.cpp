#include "server/diagnose/diagnose_options.h"

namespace trammel {

Status report_progress(const DiagnoseOptions& options, const std::string& stage, double share) {
  if (!options.progress || options.progress(stage, share)) return {};
  return failure(ErrorCode::kBusy, "diagnosis given up on request");
}

}  // namespace trammel
