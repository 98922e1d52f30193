#pragma once

#include <memory>
#include <set>
#include <string>

#include "tests/support/change_load.h"
#include "tests/support/daemon.h"
#include "tests/support/patroni.h"

namespace trammel::test {

/// Two servers whose record is a PostgreSQL of three hosts; a training host, killed since, has made
/// versions 1 and 2 of cell-7.
class FailingOver {
 public:
  FailingOver();
  /// The reason from Patroni; then nothing else may be called.
  [[nodiscard]] const std::string& why_not() const { return record.why_not(); }
  [[nodiscard]] client::SessionOptions session_options() const;

  /// Acknowledged changes that the record does not have.
  [[nodiscard]] std::set<std::string> lost(const ChangeLoad& load) const;
  /// Changes and jobs that occur twice, and faults of the trail; empty: none.
  [[nodiscard]] std::string twice() const;

  /// From a version that is put in force on the first server until the second one serves it, s;
  /// meanwhile nobody else changes anything.
  [[nodiscard]] double until_served_elsewhere_s() const;

  Patroni record;
  std::string url;
  std::unique_ptr<Daemon> first, second;

 private:
  void start(Daemon& server, const std::string& keys) const;
};

}  // namespace trammel::test
