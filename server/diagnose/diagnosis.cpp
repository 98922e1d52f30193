#include "server/diagnose/diagnosis.h"

#include "server/error_sources/catalogue.h"

namespace trammel {

std::string to_string(const Cause& cause) {
  if (!cause.parameter.empty()) return cause.cause + ":" + cause.parameter;
  return cause.joint < 0 ? cause.cause : fmt::format("{}:{}", cause.cause, cause.joint + 1);
}

Cause cause_from(std::string_view spelling) {
  const std::string_view name = spelling.substr(0, spelling.find(':'));
  if (find_cause(name) == nullptr || name.size() == spelling.size()) return {std::string(spelling)};
  Cause cause{std::string(name)};
  const std::string rest(spelling.substr(name.size() + 1));
  const bool is_joint = !rest.empty() && rest.find_first_not_of("0123456789") == std::string::npos;
  if (is_joint) {
    cause.joint = std::stoi(rest) - 1;
  } else {
    cause.parameter = rest;
  }
  return cause;
}

namespace {

/// Of the joint, or of any where it is -1.
std::string named(const Cause& cause, int joint) {
  const CauseRecord* record = find_cause(cause.cause);
  std::string words = record != nullptr ? plain_name(*record, joint) : cause.cause;
  if (!cause.parameter.empty()) words += fmt::format(" ({})", cause.parameter);
  return words;
}

}  // namespace

std::string in_words(const Cause& cause) {
  return named(cause, cause.joint) + (cause.pose_id.empty() ? "" : fmt::format(" at pose {}", cause.pose_id));
}

std::string kind_in_words(const Cause& cause) { return named(cause, -1); }

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
