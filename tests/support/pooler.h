#pragma once

#include <optional>
#include <string>

#include "tests/support/postgres.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A pgbouncer before a PostgreSQL: its clients share two connections, transaction by transaction.
class Pooler {
 public:
  explicit Pooler(const Postgres& server);
  /// The URL of the same database through the pooler.
  [[nodiscard]] std::string through(std::string url) const;

 private:
  std::string server_folder_;
  TemporaryFolder folder_;
  std::optional<Process> pooler_;
};

}  // namespace trammel::test
