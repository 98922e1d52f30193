#include "clients/cli/terminal/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

#include "server/base/plain_text.h"

namespace trammel::cli {

namespace {

constexpr double kLongestTimeout = 3600;  // s

void add_discovery_option(CLI::App& command, ServiceOptions& options) {
  command
      .add_option("--discovery-server", options.discovery_servers,
                  "A discovery server that tells where services are: a name or IPv4 address, with "
                  ":PORT behind it or not; once for each, in the order of their numbers")
      ->allow_extra_args(false)
      ->group("Service");
}

void add_service_options(CLI::App& command, ServiceOptions& options, const std::string& help) {
  command.add_flag("--service", options.service, help)->group("Service");
  command
      .add_option("--host", options.hosts,
                  "Where the service runs: a name or IPv4 address, with :PORT behind it or not; "
                  "once for each server on another host")
      ->allow_extra_args(false)
      ->capture_default_str()
      ->group("Service");
  command.get_option("--host")->each([&options](const std::string&) { options.hosts_said = true; });
  add_discovery_option(command, options);
  command
      .add_option(
          "--port", options.ports,
          "UDP port of the service on each host that is named without one; once for each server")
      ->allow_extra_args(false)
      ->capture_default_str()
      ->group("Service");
  command
      .add_option("--domain", options.domain,
                  "DDS domain of the service; servers of other domains are not heard")
      ->check(CLI::Range(0, 232))
      ->capture_default_str()
      ->group("Service");
  command
      .add_option(
          "--security", options.security,
          "Folder with the certificate, key and permissions that a secured service asks for")
      ->type_name("FOLDER")
      ->group("Service");
  command
      .add_option("--timeout", options.timeout_s,
                  "Longest wait for one answer, finding the service included, s")
      ->check(CLI::Range(0.01, kLongestTimeout))
      ->capture_default_str()
      ->group("Service");
}

}  // namespace

void add_service_options(CLI::App& command, ServiceOptions& options) {
  add_service_options(command, options, "Ask a running trammeld instead of working on files");
}

void add_options_of_service_command(CLI::App& command, ServiceOptions& options) {
  add_service_options(command, options, "Said or not: this command always asks a running trammeld");
}

Result<std::vector<HostPort>> discovery_servers_of(const ServiceOptions& options) {
  std::vector<HostPort> places;
  for (const std::string& text : options.discovery_servers) {
    auto place = parse_host_port(text, kDiscoveryPort);
    if (!place)
      return Failure(std::move(place.error()))
          .of("--discovery-server")
          .next("name it as line-3:11811");
    if (std::find(places.begin(), places.end(), *place) != places.end())
      return failure(ErrorCode::kUsage, "{} is given twice", text)
          .of("--discovery-server")
          .with_text(text);
    places.push_back(*std::move(place));
  }
  if (places.size() > kMostDiscoveryServers)
    return failure(ErrorCode::kUsage, "{} discovery servers, limit {}", places.size(),
                   kMostDiscoveryServers)
        .of("--discovery-server");
  return places;
}

Result<std::vector<HostPort>> places_of(const ServiceOptions& options) {
  if (!options.discovery_servers.empty() && !options.hosts_said) return std::vector<HostPort>();
  auto places = parse_hosts(options.hosts, options.ports);
  if (!places)
    return Failure(std::move(places.error())).of("--host").next("name it as --host line-3:17500");
  return places;
}

Result<std::unique_ptr<client::Session>> open_session(const ServiceOptions& options) {
  auto places = places_of(options);
  if (!places) return tl::make_unexpected(places.error());
  auto discovery_servers = discovery_servers_of(options);
  if (!discovery_servers) return tl::make_unexpected(discovery_servers.error());
  client::SessionOptions session;
  session.servers = *std::move(places);
  session.discovery_servers = *std::move(discovery_servers);
  session.security = options.security;
  session.domain = options.domain;
  session.timeout = std::chrono::milliseconds(static_cast<std::int64_t>(options.timeout_s * 1e3));
  return client::Session::open(session);
}

void need_finite_numbers(CLI::App& app) {
  const CLI::Validator finite(
      [](const std::string& text) {
        char* end = nullptr;
        const double value = std::strtod(text.c_str(), &end);
        const bool is_number = !text.empty() && *end == '\0';
        return is_number && !std::isfinite(value)
                   ? fmt::format("{} is no number that can be used", text)
                   : std::string();
      },
      "");
  for (CLI::Option* option : app.get_options()) {
    if (option->get_type_name().starts_with("FLOAT")) option->check(finite);
  }
  for (CLI::App* below : app.get_subcommands([](CLI::App*) { return true; }))
    need_finite_numbers(*below);
}

CLI::Validator above_zero() {
  return CLI::Validator(
      [](const std::string& text) {
        double value = 0;
        const char* end = text.data() + text.size();
        const auto [stop, error] = std::from_chars(text.data(), end, value);
        const bool fine = error == std::errc() && stop == end && value > 0 && std::isfinite(value);
        return fine ? std::string() : "'" + text + "', expected a number above 0, without a unit";
      },
      "above 0");
}

void add_seed_option(CLI::App& command, std::uint64_t& seed, const std::string& help) {
  // Read as an unsigned number, -1 would silently become the largest one.
  const CLI::Validator whole(
      [](const std::string& text) {
        const bool digits =
            !text.empty() && std::all_of(text.begin(), text.end(),
                                         [](unsigned char c) { return c >= '0' && c <= '9'; });
        return digits ? std::string() : "'" + text + "', expected a whole number from 0";
      },
      "");
  command.add_option("--seed", seed, help)->check(whole)->capture_default_str();
}

void add_json_option(CLI::App& command, std::string& path) {
  command
      .add_option(
          "--json", path,
          "Also write the result as JSON, for programs, to this file ('-': standard output)")
      ->type_name("FILE");
}

bool take_form(const std::string& word, TableForm& form, std::string& json) {
  if (word == "wide") form = TableForm::kWide;
  if (word == "json") json = "-";
  return word == "wide" || word == "json";
}

void add_form_option(CLI::App& command, TableForm& form, std::string& json) {
  command
      .add_option_function<std::string>(
          "-o,--form", [&form, &json](const std::string& word) { take_form(word, form, json); },
          "The table with all columns (wide), or the result for programs on standard output (json)")
      ->check(CLI::IsMember(std::vector<std::string>{"wide", "json"}));
}

CLI::Option* add_batches_option(CLI::App& command, std::vector<std::string>& paths) {
  return command
      .add_option("--batch", paths,
                  "Measurements (CSV: joints in deg, rails in mm; positions in mm); again for each "
                  "measuring session: the tracker may stand elsewhere in each")
      ->allow_extra_args(false);
}

CLI::Option* add_model_option(CLI::App& command, std::string& model) {
  return command
      .add_option("--model", model,
                  "Model file, or CELL@VERSION of a service; with --service also a cell's id: its "
                  "model in force")
      ->required();
}

void add_tool_options(CLI::App& command, std::string& tool, std::string& payload) {
  command.add_option(
      "--tool", tool,
      "Tool id of the cell, for rows that name none; may be left out where the cell has only one");
  command.add_option("--payload", payload,
                     "Payload id of the cell, for rows that name none; may be left out where the "
                     "cell has only one");
}

}  // namespace trammel::cli
