#pragma once

#include <cstdint>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "server/base/result.h"

/// Requests of clients and their answers, for tests/faults/history/history_check.py: a JSON object
/// per line.
namespace trammel::test {

/// Microseconds of a clock common to all processes of this host.
[[nodiscard]] std::int64_t monotonic_us();

/// Thread-safe.
class History {
 public:
  explicit History(const std::string& path) : out_(path) {}

  void add(const nlohmann::json& record);

  /// Calls `call`, whose Result<nlohmann::json> has additional members for the record, and adds the
  /// record with its times and the answer. Returns the answer: `ok`, `conflict`, `not_found`,
  /// `refused`, or `unknown` if the change may or may not have been made.
  template <typename Call>
  std::string ask(nlohmann::json record, const Call& call) {
    record["invoke"] = monotonic_us();
    const Result<nlohmann::json> answered = call();
    record["complete"] = monotonic_us();
    if (answered) {
      record.update(*answered);
      record["answer"] = "ok";
    } else {
      add_error(record, answered.error());
    }
    add(record);
    return record["answer"];
  }

 private:
  static void add_error(nlohmann::json& record, const Error& error);

  std::mutex mutex_;
  std::ofstream out_;
};

}  // namespace trammel::test
