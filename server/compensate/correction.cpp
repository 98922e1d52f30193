#include "server/compensate/correction.h"

namespace trammel {

std::string_view to_string(CorrectionStatus status) {
  switch (status) {
    case CorrectionStatus::kOk:
      return "ok";
    case CorrectionStatus::kOutOfDomain:
      return "out_of_domain";
    case CorrectionStatus::kJointLimit:
      return "joint_limit";
    case CorrectionStatus::kUnreachable:
      return "unreachable";
    case CorrectionStatus::kSingular:
      return "singular";
    case CorrectionStatus::kNotConverged:
      return "not_converged";
    case CorrectionStatus::kRefused:
      return "refused";
  }
  return "refused";
}

}  // namespace trammel
