// The cost of many clients for a server and the line to it: participants of DDS on another host (a
// network namespace), each with a session that has been answered once and then only stays. Measured
// on the line while they come and while nobody asks, in the server's memory, and after they have
// gone.
// --clients N..., --cells N, --seconds N (of quiet, each). The clients are this program again,
// --stay.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "clients/session/session.h"
#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/two_hosts.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::seconds;

constexpr seconds kLimit{300};
constexpr int kOfOneProcess = 25;  // clients

struct Settings {
  std::vector<int> clients = {1, 50, 200};
  int cells = 50, quiet_seconds = 10;
};

struct Stay {
  std::string host;
  std::uint16_t port = 0;
  std::uint32_t domain = 0;
  int clients = 0;
};

/// Opens sessions, has each answered once, says so, and stays until SIGTERM ends the process.
[[noreturn]] void stay(const Stay& asked) {
  client::SessionOptions options;
  options.domain = asked.domain;
  options.servers = {{asked.host, asked.port}};
  options.timeout = seconds(60);
  std::vector<std::unique_ptr<client::Session>> sessions;
  for (int i = 0; i < asked.clients; ++i) {
    sessions.push_back(test::demand(client::Session::open(options)));
    static_cast<void>(test::demand(sessions.back()->models("cell-1")));
  }
  std::cout << "answered\n";
  std::cout.flush();
  while (true) ::pause();
}

/// A daemon of many cells on the first host.
class Service {
 public:
  Service(const test::TwoHosts& hosts, int cells) : hosts_(hosts) {
    const auto folder = std::filesystem::path(daemon_.config_path()).parent_path();
    const std::string cell = test::read_file(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml");
    std::string names;
    for (int i = 1; i <= cells; ++i) {
      const std::string name = fmt::format("cell-{}", i);
      write(folder / (name + ".yaml"), with_name(cell, name));
      names += (names.empty() ? "" : ", ") + name + ".yaml";
    }
    write(daemon_.config_path(),
          fmt::format("version: 1\nserver: plant\ncells: [{}]\nstore: trammel.db\n"
                      "dds: {{address: {}, allow_network: true, without_security: true}}\n",
                      names, hosts.address(0)));
    process_ = std::make_unique<test::Process>(hosts.on(0, daemon_.command_line()));
    if (!process_->wait_for_line("ready", kLimit)) fail(process_->standard_error());
  }

  [[nodiscard]] std::unique_ptr<test::Process> with_clients(int count) const {
    std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(),
                                      "--stay",
                                      hosts_.address(0),
                                      "--stay-port",
                                      std::to_string(daemon_.port()),
                                      "--stay-domain",
                                      std::to_string(daemon_.domain()),
                                      "--clients",
                                      std::to_string(count)};
    return std::make_unique<test::Process>(hosts_.on(1, std::move(words)));
  }
  /// MB of its memory, and s of its processor.
  [[nodiscard]] double memory_mb() const {
    std::ifstream status(fmt::format("/proc/{}/status", daemon_pid()));
    for (std::string line; std::getline(status, line);)
      if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024;
    return std::nan("");
  }
  [[nodiscard]] double processor_s() const {
    std::ifstream stat(fmt::format("/proc/{}/stat", daemon_pid()));
    std::string text{std::istreambuf_iterator<char>(stat), {}};
    std::istringstream words(text.substr(text.rfind(')') + 2));
    std::string word;
    double user = 0, system = 0;
    for (int i = 3; i < 14; ++i) words >> word;
    words >> user >> system;
    return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  }
  /// Bytes that the server's host has received and sent.
  [[nodiscard]] std::pair<double, double> carried() const {
    std::istringstream lines(test::run(hosts_.on(0, {"/bin/cat", "/proc/net/dev"})).out);
    double in = 0, out = 0;
    for (std::string line; std::getline(lines, line);) {
      const std::size_t colon = line.find(':');
      if (colon == std::string::npos || line.substr(0, colon).ends_with("lo")) continue;
      std::istringstream numbers(line.substr(colon + 1));
      double received = 0, sent = 0, other = 0;
      numbers >> received;
      for (int i = 0; i < 7; ++i) numbers >> other;
      numbers >> sent;
      in += received;
      out += sent;
    }
    return {in, out};
  }

 private:
  [[noreturn]] static void fail(const std::string& why) {
    fmt::print(stderr, "{}\n", why);
    std::exit(1);
  }
  static void write(const std::filesystem::path& path, const std::string& text) {
    static_cast<void>(test::demand(write_text_file(path.string(), text).map([] { return true; })));
  }
  static std::string with_name(std::string cell, const std::string& name) {
    const std::string robot = "../models/";
    cell.replace(cell.find("cell: cell-7"), 12, "cell: " + name);
    for (std::size_t at = 0; (at = cell.find(robot, at)) != std::string::npos;)
      cell.replace(at, robot.size(), TRAMMEL_SOURCE_DIR "/models/");
    return cell;
  }
  /// `ip netns exec` becomes the daemon.
  [[nodiscard]] pid_t daemon_pid() const { return process_->pid(); }

  const test::TwoHosts& hosts_;
  test::Daemon daemon_;
  std::unique_ptr<test::Process> process_;
};

void tell_clients(const Service& service, const Settings& settings, int count) {
  const double memory_before = service.memory_mb();
  const auto before = service.carried();
  const auto began = Clock::now();
  std::vector<std::unique_ptr<test::Process>> clients;
  for (int left = count; left > 0; left -= kOfOneProcess)
    clients.push_back(service.with_clients(std::min(left, kOfOneProcess)));
  for (const auto& process : clients)
    if (!process->wait_for_line("answered", kLimit))
      return static_cast<void>(fmt::print("{}\n", process->standard_error()));
  const double took = std::chrono::duration<double>(Clock::now() - began).count();
  const auto joined = service.carried();
  const double processor = service.processor_s();
  static_cast<void>(clients.front()->wait(seconds(settings.quiet_seconds)));  // it stays
  const auto after = service.carried();
  const double quiet = settings.quiet_seconds;
  const std::string name = fmt::format("{} clients, {} cells: ", count, settings.cells);
  test::tell_figure(name + "until all were answered, s", took);
  test::tell_figure(name + "on the line until then, MB",
                    1e-6 * (joined.first + joined.second - before.first - before.second));
  test::tell_figure(name + "to the server where nobody asks, kB/s",
                    1e-3 * (after.first - joined.first) / quiet);
  test::tell_figure(name + "from the server where nobody asks, kB/s",
                    1e-3 * (after.second - joined.second) / quiet);
  test::tell_figure(name + "processor where nobody asks, %",
                    100 * (service.processor_s() - processor) / quiet);
  test::tell_figure(name + "memory of the server more, MB", service.memory_mb() - memory_before);
  for (const auto& process : clients) process->signal(SIGTERM);
  for (const auto& process : clients) static_cast<void>(process->wait(kLimit));
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What many clients cost a server and the line to it.");
  trammel::Settings settings;
  trammel::Stay stay;
  app.add_option("--clients", settings.clients);
  app.add_option("--cells", settings.cells);
  app.add_option("--seconds", settings.quiet_seconds);
  app.add_option("--stay", stay.host);
  app.add_option("--stay-port", stay.port);
  app.add_option("--stay-domain", stay.domain);
  CLI11_PARSE(app, argc, argv);
  if (!stay.host.empty()) {
    stay.clients = settings.clients.front();
    trammel::stay(stay);
  }
  for (const int count : settings.clients) {
    const trammel::test::TwoHosts hosts;
    if (!hosts.why_not().empty()) {
      fmt::print("skipped: {}\n", hosts.why_not());
      return 0;
    }
    trammel::tell_clients(trammel::Service(hosts, settings.cells), settings, count);
  }
  return 0;
}
