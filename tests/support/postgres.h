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
  /// kWaitedFor: a commit is on the disk when it is acknowledged. kSmall: it also has a disk of 64
  /// MB, the tablespace `small` with a ballast of 16 MB.
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
  /// What a statement says in that database, a line a row; aborts where it fails.
  std::string sql(const std::string& url, const std::string& statement) const;
  /// What the clients of that database that connect from now on ask of it is written down.
  void write_down(const std::string& url) const;
  /// What was asked of it since this was called last, a text for each way of a client to the server
  /// and back.
  [[nodiscard]] std::vector<std::string> asked();

  /// From now on it is at `localhost` on that port, too, with TLS and for who has a certificate of
  /// his role alone.
  void take_certificates(std::uint16_t port);
  /// By that way, as libpq's most careful: the name and the certificate of the server are compared,
  /// and the client shows its own. The role `keeper` has one.
  [[nodiscard]] std::string certified_url(const std::string& database,
                                          const std::string& role = "keeper") const;
  /// In this folder: `ca.crt`, `other-ca.crt`, `keeper.crt`, `keeper.key`.
  [[nodiscard]] std::string certificates() const { return folder_.file("certificates"); }

  void start();
  void stop();
  /// SIGKILL for the one that has started all the others, which end by themselves; until none is
  /// left.
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
  std::uint16_t port_ = 0;  // on which it takes certificates; 0: it takes none
  int databases_ = 0;
  int marks_ = 0;
  std::size_t read_of_log_ = 0;
};

/// Somebody's psql, which holds a table of that database locked until the end of this.
class LockedTable {
 public:
  LockedTable(const std::string& url, const std::string& table, const std::string& mode);
  ~LockedTable();

 private:
  Process psql_;
};

}  // namespace trammel::test
