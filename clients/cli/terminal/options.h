#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/cli/terminal/names.h"
#include "clients/cli/terminal/table.h"
#include "clients/session/session.h"
#include "server/base/result.h"

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

/// Options that several commands have.
namespace trammel::cli {

/// The options that choose between files and a service, and select the service.
struct ServiceOptions {
  bool service = false;
  std::vector<std::string> hosts = {
      "127.0.0.1"};  ///< names or addresses, each with a port behind it or not
  std::vector<std::string> discovery_servers;  ///< likewise
  bool hosts_said = false;  ///< false: if discovery servers are given, only hosts announced by them
                            ///< count
  std::string security;     ///< folder of certificate and permissions; empty: none
  std::uint32_t domain = 0;
  std::vector<std::uint16_t> ports = {17500};
  double timeout_s = 5;
};
/// The options of commands that work on files or ask a service.
void add_service_options(CLI::App& command, ServiceOptions& options);
/// The options of commands that only a service can carry out: `--service` may be said and changes
/// nothing.
void add_options_of_service_command(CLI::App& command, ServiceOptions& options);
/// The places to search for servers: each host with its own port, or with every port; none if only
/// discovery servers were given. kUsage: an unknown host.
[[nodiscard]] Result<std::vector<HostPort>> places_of(const ServiceOptions& options);
[[nodiscard]] Result<std::unique_ptr<client::Session>> open_session(const ServiceOptions& options);

/// Makes every number option of the command and its subcommands refuse nan and inf.
void need_finite_numbers(CLI::App& app);
/// A number above 0.
[[nodiscard]] CLI::Validator above_zero();
/// `--seed`: a whole number from 0.
void add_seed_option(CLI::App& command, std::uint64_t& seed, const std::string& help);
void add_json_option(CLI::App& command, std::string& path);
/// `-o wide|json` of a command that prints a table; json goes to standard output, as `--json -`.
void add_form_option(CLI::App& command, TableForm& form, std::string& json);
/// Takes such a word. Returns false for any other word.
bool take_form(const std::string& word, TableForm& form, std::string& json);
/// `--batch FILE`, again for each: every one is a measuring session.
CLI::Option* add_batches_option(CLI::App& command, std::vector<std::string>& paths);
/// `--model`, of a file or of a service; required.
CLI::Option* add_model_option(CLI::App& command, std::string& model);
void add_tool_options(CLI::App& command, std::string& tool, std::string& payload);

}  // namespace trammel::cli
