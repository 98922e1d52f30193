#include "server/diagnose/diagnosis.h"

namespace trammel {

std::string to_string(const Cause& cause) {
  if (!cause.parameter.empty()) return cause.cause + ":" + cause.parameter;
  return cause.joint < 0 ? cause.cause : fmt::format("{}:{}", cause.cause, cause.joint + 1);
}

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNamed:
      return "named";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kUnknown:
      return "unknown";
    case Verdict::kNothing:
      return "nothing";
  }
  return "nothing";
}

}  // namespace trammel
