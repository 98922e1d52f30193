#include "server/store/job_outcome.h"

#include <array>
#include <utility>

namespace trammel {

namespace {

constexpr std::array<ErrorCode, 8> kCodes = {
    ErrorCode::kUsage,    ErrorCode::kRefused, ErrorCode::kNotFound,    ErrorCode::kConflict,
    ErrorCode::kTooLarge, ErrorCode::kBusy,    ErrorCode::kUnreachable, ErrorCode::kInternal};

constexpr std::array<std::pair<JobVerdict, const char*>, 11> kVerdicts = {
    {{JobVerdict::kOpen, "open"},
     {JobVerdict::kInForce, "in_force"},
     {JobVerdict::kNotBetter, "not_better"},
     {JobVerdict::kUndecided, "undecided"},
     {JobVerdict::kDiagnosed, "diagnosed"},
     {JobVerdict::kNothingApplied, "nothing_applied"},
     {JobVerdict::kQuarantined, "quarantined"},
     {JobVerdict::kRefused, "refused"},
     {JobVerdict::kOverLimit, "over_limit"},
     {JobVerdict::kBroken, "broken"},
     {JobVerdict::kCancelled, "cancelled"}}};

}  // namespace

const char* to_text(JobVerdict verdict) {
  for (const auto& [value, text] : kVerdicts) {
    if (value == verdict) return text;
  }
  return "";
}

std::optional<JobVerdict> job_verdict_of(std::string_view text) {
  for (const auto& [value, name] : kVerdicts) {
    if (text == name) return value;
  }
  return std::nullopt;
}

std::optional<ErrorCode> error_code_of(std::string_view text) {
  for (const ErrorCode code : kCodes) {
    if (text == to_text(code)) return code;
  }
  return std::nullopt;
}

}  // namespace trammel
