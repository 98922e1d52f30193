#include "tests/support/daemon.h"

#include <gtest/gtest.h>
#include <signal.h>

#include "tests/support/own_ports.h"
#include "tests/support/virtual_cell.h"

namespace trammel::test {
namespace {

constexpr std::chrono::seconds kLimit{30};

/// The shipped cell, with a bias that is always learned, so that a training takes time and gives a
/// model to serve.
std::string cell_with_a_bias() {
  std::string text = read_file(shipped_cell_file());
  const auto replace = [&](const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    text.replace(at, what.size(), by);
  };
  replace("../models", TRAMMEL_SOURCE_DIR "/models");
  replace("bias: auto", "bias: se");
  return text;
}

}  // namespace

std::string trammeld_path() { return TRAMMEL_BINARY_DIR "/server/trammeld"; }

Daemon::Daemon(int number)
    : port_(static_cast<std::uint16_t>(own_ports() + 2 * number)), domain_(own_domain()) {
  folder_.write("cell-7.yaml", cell_with_a_bias());
  folder_.write("server.yaml", fmt::format("version: 1\nserver: {}\ncells: [cell-7.yaml]\nstore: "
                                           "trammel.db\nlog: {{level: debug}}\n",
                                           name()));
}

std::vector<std::string> Daemon::command_line() const {
  return {trammeld_path(),       "--config", config_path(),          "--port",
          std::to_string(port_), "--domain", std::to_string(domain_)};
}

void Daemon::start() {
  process_ = std::make_unique<Process>(command_line());
  EXPECT_TRUE(process_->wait_for_line("ready", kLimit)) << process_->standard_error();
}

void Daemon::kill() {
  process_->signal(SIGKILL);
  EXPECT_EQ(process_->wait(kLimit), 128 + SIGKILL);
}

std::optional<int> Daemon::stop() {
  process_->signal(SIGTERM);
  return process_->wait(kLimit);
}

client::SessionOptions Daemon::session_options() const {
  client::SessionOptions options;
  options.domain = domain_;
  options.server_ports = {port_};
  options.timeout = kLimit;  // sanitizers and a busy machine are slow
  return options;
}

}  // namespace trammel::test
