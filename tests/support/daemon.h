#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/session/session.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

[[nodiscard]] std::string trammeld_path();

/// A trammeld that serves the shipped virtual cell from a folder of its own, on a port that no
/// concurrent test has (own_ports()). It may be stopped, killed and started again on the same
/// store.
class Daemon {
 public:
  /// `number`: 1 for a second daemon of a test, on the port beside that of the first one (0).
  explicit Daemon(int number = 0);

  /// Waits until it is ready; the test fails if it does not get ready.
  void start();
  /// SIGKILL, and until it is gone.
  void kill();
  /// SIGTERM; its exit code.
  [[nodiscard]] std::optional<int> stop();

  [[nodiscard]] Process& process() { return *process_; }
  /// The command line that starts it, for tests that start another one like it.
  [[nodiscard]] std::vector<std::string> command_line() const;
  [[nodiscard]] std::string store_path() const { return folder_.file("trammel.db"); }
  [[nodiscard]] std::string config_path() const { return folder_.file("server.yaml"); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::string name() const { return "test-" + std::to_string(port_); }
  [[nodiscard]] std::uint32_t domain() const { return domain_; }
  [[nodiscard]] client::SessionOptions session_options() const;

 private:
  TemporaryFolder folder_;
  std::uint16_t port_;
  std::uint32_t domain_;
  std::unique_ptr<Process> process_;
};

}  // namespace trammel::test
