#pragma once

#include <memory>
#include <optional>
#include <string>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A PostgreSQL of the test program's own, in a temporary folder, reached by a socket there. It ends with the program.
class Postgres {
 public:
  /// Started when it is asked for first.
  static Postgres& of_program();
  Postgres();
  ~Postgres();
  Postgres(const Postgres&) = delete;
  Postgres& operator=(const Postgres&) = delete;

  /// The URL of a new database: an empty one, or one that is a store already.
  [[nodiscard]] std::string new_database();
  [[nodiscard]] std::string new_store();
  /// Of a database, for a role.
  [[nodiscard]] std::string url(const std::string& database, const std::string& role = "postgres") const;
  /// What a statement says in that database, a line a row; aborts where it fails.
  std::string sql(const std::string& url, const std::string& statement) const;

  void start();
  void stop();
  /// SIGSTOP and SIGCONT for all of its processes: it is there and answers nothing.
  void freeze(bool frozen) const;

 private:
  [[nodiscard]] std::string data() const { return folder_.file("data"); }

  TemporaryFolder folder_;
  std::optional<Process> server_;
  int databases_ = 0;
};

}  // namespace trammel::test
