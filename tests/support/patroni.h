#pragma once

#include <optional>
#include <string>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A PostgreSQL of three hosts with automatic failover, by the files of deploy/patroni. The hosts
/// are network namespaces, and so is the place of this thread and of all processes that it starts
/// from now on. They end with the test.
class Patroni {
 public:
  Patroni();
  ~Patroni();
  Patroni(const Patroni&) = delete;
  Patroni& operator=(const Patroni&) = delete;

  /// Empty, or why there is none: it takes root and the packages.
  [[nodiscard]] const std::string& why_not() const { return why_not_; }
  /// A new store that `trammel`, the role of the URL, may use.
  [[nodiscard]] std::string new_store();
  /// The result of a statement for the owner, a line per row; aborts if it fails.
  [[nodiscard]] std::string sql(const std::string& statement) const;
  /// The number of the host that takes changes, 1 to 3; 0: none does.
  [[nodiscard]] int primary() const;
  /// Acts on a host: `kill`, `freeze`, `thaw`, `start` on all of its processes; `cut`, `mute` (it
  /// cannot send), `deaf` (it cannot receive), `mend` on its line.
  void act(const std::string& what, int host) const;
  /// Until both other hosts follow, and would take over.
  [[nodiscard]] bool wait_until_whole() const;

 private:
  [[nodiscard]] Finished ask(const std::string& what, const std::string& more = "") const;
  [[nodiscard]] std::string url(const std::string& role, const std::string& database) const;

  TemporaryFolder folder_;
  int outside_ = -1;  // the network namespace of before
  std::optional<Process> cluster_;
  std::string why_not_;
};

}  // namespace trammel::test
