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
  /// kWaitedFor: a commit is on the disk when it is acknowledged. kSmall: it also has a disk of 64 MB, the tablespace
  /// `small` with a ballast of 16 MB.
  enum class Disk { kOwn, kWaitedFor, kSmall };
  explicit Postgres(Disk disk = Disk::kOwn);
  ~Postgres();
  Postgres(const Postgres&) = delete;
  Postgres& operator=(const Postgres&) = delete;

  /// The URL of a new database: an empty one, or one that is a store already.
  [[nodiscard]] std::string new_database();
  [[nodiscard]] std::string new_store(const std::string& more = "");
  /// Of a database, for a role. The role `needs_password` is let in with one only, `right`.
  [[nodiscard]] std::string url(const std::string& database, const std::string& role = "postgres") const;
  /// What a statement says in that database, a line a row; aborts where it fails.
  std::string sql(const std::string& url, const std::string& statement) const;

  void start();
  void stop();
  /// SIGKILL for the one that has started all the others, which end by themselves; until none is left.
  void kill();
  /// From now on it answers, and takes no change: the standby of nobody.
  void become_standby();
  /// Takes the ballast from the small disk.
  void make_room() const;
  /// SIGSTOP and SIGCONT for all of its processes: it is there and answers nothing.
  void freeze(bool frozen) const;

 private:
  [[nodiscard]] std::string data() const { return folder_.file("data"); }

  [[nodiscard]] std::string small_disk() const { return folder_.file("small"); }
  void start_until(const std::string& line);

  TemporaryFolder folder_;
  const Disk disk_;
  std::optional<Process> server_;
  int databases_ = 0;
};

}  // namespace trammel::test
