#include "tests/support/history.h"

#include <chrono>

namespace trammel::test {

std::int64_t monotonic_us() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

void History::add(const nlohmann::json& record) {
  const std::string line = record.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const std::lock_guard lock(mutex_);
  out_ << line << std::endl;
}

void History::add_error(nlohmann::json& record, const Error& error) {
  switch (error.code) {
    case ErrorCode::kConflict:
      record["answer"] = "conflict";
      break;
    case ErrorCode::kNotFound:
      record["answer"] = "not_found";
      break;
    case ErrorCode::kRefused:
    case ErrorCode::kUsage:
    case ErrorCode::kTooLarge:
      record["answer"] = "refused";
      break;
    default:
      record["answer"] = "unknown";
  }
  record["about"] = error.field;
  record["why"] = error.message;
}

}  // namespace trammel::test
