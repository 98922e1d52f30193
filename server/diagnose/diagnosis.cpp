#include "server/diagnose/diagnosis.h"

#include "server/error_sources/catalogue.h"

namespace trammel {

std::string to_string(const Cause& cause) {
  if (!cause.parameter.empty()) return cause.cause + ":" + cause.parameter;
  return cause.joint < 0 ? cause.cause : fmt::format("{}:{}", cause.cause, cause.joint + 1);
}

const CauseRecord& record_of(const Cause& cause) { return cause_spelled(cause.cause); }

std::string in_words(const Cause& cause) {
  const CauseRecord* record = find_cause(cause.cause);
  if (record == nullptr) return to_string(cause);
  std::string words = plain_name(*record, cause.joint);
  if (!cause.parameter.empty()) words += fmt::format(" ({})", cause.parameter);
  if (cause.pose_id.empty()) return words;
  const bool begins = record->lasting == causes::Lasting::kFromAPose;
  return words +
         fmt::format(fmt::runtime(begins ? " from pose {} on" : ", pose {}"), cause.pose_id);
}

std::string kind_in_words(const Cause& cause) {
  return in_words(Cause{.cause = cause.cause, .parameter = cause.parameter});
}

namespace {

bool may_show_what_lacks(const Cause& cause, bool is_in_doubt) {
  const CauseRecord* record = find_cause(cause.cause);
  return is_in_doubt && record != nullptr && record->search == causes::SearchFamily::kPose;
}

constexpr const char* kMissed = "pose that the simulation misses";

}  // namespace

std::string called(const Cause& cause, bool is_in_doubt) {
  return may_show_what_lacks(cause, is_in_doubt)
             ? fmt::format("{}, pose {}", kMissed, cause.pose_id)
             : in_words(cause);
}

std::string kind_called(const Cause& cause, bool is_in_doubt) {
  return may_show_what_lacks(cause, is_in_doubt) ? kMissed : kind_in_words(cause);
}

Cause cause_at(const CauseRecord& record, int joint) {
  Cause cause;
  cause.cause = record.spelling;
  cause.joint = joint;
  return cause;
}

void add(std::vector<Cause>& causes, const Cause& cause) {
  if (std::find(causes.begin(), causes.end(), cause) == causes.end()) causes.push_back(cause);
}

Cause unknown_cause(int joint) {
  return cause_at(cause_that_stands_for(causes::StandsFor::kNoKnownCause), joint);
}

std::string verdict_in_words(std::string_view verdict) {
  const std::string beyond = verdict == to_string(Verdict::kNothing) ? " beyond the model" : "";
  return std::string(verdict) + beyond;
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
