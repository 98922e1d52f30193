#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A PostgreSQL of the test program's own, in a temporary folder, reached by a socket there. It
/// ends with the program.
class Postgres {
 public:
  /// Started when it is asked for first.
  static Postgres& of_program();
  /// kWaitedFor: a commit is on the disk before it is acknowledged. kSmall: additionally a disk of
  /// 64 MB, the tablespace `small` with a ballast of 16 MB.
  enum class Disk { kOwn, kWaitedFor, kSmall };
  explicit Postgres(Disk disk = Disk::kOwn);
  ~Postgres();
  Postgres(const Postgres&) = delete;
  Postgres& operator=(const Postgres&) = delete;

  /// The URL of a new database: an empty one, or one that is a store already.
  [[nodiscard]] std::string new_database();
  [[nodiscard]] std::string new_store(const std::string& more = "");
  /// Of a database, for a role. The role `needs_password` is let in with one only, `right`.
  [[nodiscard]] std::string url(const std::string& database,
                                const std::string& role = "postgres") const;
  /// The result of a statement in that database, a line per row; aborts if it fails.
  std::string sql(const std::string& url, const std::string& statement) const;
  /// Records the statements of clients that connect to that database from now on.
  void write_down(const std::string& url) const;
  /// The statements since the last call, a text for each round trip of a client.
  [[nodiscard]] std::vector<std::string> asked();

  /// Makes the server listen at `localhost` on that port as well, with TLS and only for clients
  /// with a certificate of their role.
  void take_certificates(std::uint16_t port);
  /// The URL for that way with libpq's strictest checks: the name and the certificate of the server
  /// are compared, and the client shows its own. The role `keeper` has one.
  [[nodiscard]] std::string certified_url(const std::string& database,
                                          const std::string& role = "keeper") const;
  /// The folder with `ca.crt`, `other-ca.crt`, `keeper.crt`, `keeper.key`.
  [[nodiscard]] std::string certificates() const { return folder_.file("certificates"); }

  void start();
  void stop();
  /// SIGKILL for the one that has started all the others, which end by themselves; until none is
  /// left.
  void kill();
  /// Makes it answer and reject changes, as a standby without a primary.
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
  std::uint16_t port_ = 0;  // the port for certificates; 0: none
  int databases_ = 0;
  int marks_ = 0;
  std::size_t read_of_log_ = 0;
};

/// A foreign psql session that locks a table of that database until this object ends.
class LockedTable {
 public:
  LockedTable(const std::string& url, const std::string& table, const std::string& mode);
  ~LockedTable();

 private:
  Process psql_;
};

}  // namespace trammel::test
