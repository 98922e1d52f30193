// What a bad line and certificates cost: a client on another host asks for one target after the
// other. How long it waits behind a line that loses, holds back and shuffles frames, or is cut; and
// beside a plain server, what security adds. --only line|cut|security, --seconds N, --cuts N. The
// client is this program again, --ask.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <string_view>

#include "clients/session/session.h"
#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/two_hosts.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds kLimit{120};

struct Asked {
  std::string host, security;
  std::uint16_t port = 0;
  std::uint32_t domain = 0;
  int most_seconds = 10, requests = 0;
};

bool same(const exchange::CorrectedTarget& a, const exchange::CorrectedTarget& b) {
  return a.status == b.status && a.joints_deg == b.joints_deg &&
         a.commanded.xyz_mm == b.commanded.xyz_mm && a.sigma_mm == b.sigma_mm;
}

/// A line of output for each answer: when it was asked and answered, ns of the steady clock, and
/// what it was.
int ask(const Asked& asked) {
  client::SessionOptions options;
  options.domain = asked.domain;
  options.servers = {{asked.host, asked.port}};
  options.security = asked.security;
  options.timeout = seconds(1);
  const auto session = test::demand(client::Session::open(options));
  client::CallContext context;
  context.cell = "cell-7";
  exchange::AskedTarget target;
  target.pose = {1800, 125, 1200, 0.7071067811865476, 0, 0.7071067811865476, 0};
  target.conf = 0;
  std::optional<exchange::CorrectedTarget> first;
  const auto end = Clock::now() + seconds(asked.most_seconds);
  for (int i = 0; (asked.requests == 0 || i < asked.requests) && Clock::now() < end; ++i) {
    const auto began = Clock::now();
    const auto answer = session->correct_targets(context, {target});
    const auto ended = Clock::now();
    if (answer && !first) first = answer->items[0];
    const char* what = !answer ? "none" : same(answer->items[0], *first) ? "right" : "wrong";
    std::cout << began.time_since_epoch().count() << ' ' << ended.time_since_epoch().count() << ' '
              << what << '\n';
  }
  return 0;
}

struct Call {
  Clock::rep began = 0, ended = 0;
  std::string what;
  [[nodiscard]] double ms() const { return 1e-6 * static_cast<double>(ended - began); }
};

std::vector<Call> calls_in(const std::string& text) {
  std::vector<Call> calls;
  std::istringstream lines(text);
  for (Call call; lines >> call.began >> call.ended >> call.what;) calls.push_back(call);
  return calls;
}

double share_of_times(const std::vector<Call>& calls, double share) {
  std::vector<double> times;
  for (const Call& call : calls) {
    if (call.what == "right") times.push_back(call.ms());
  }
  if (times.empty()) return std::nan("");
  std::sort(times.begin(), times.end());
  return times[std::min(times.size() - 1,
                        static_cast<std::size_t>(share * static_cast<double>(times.size())))];
}

double count_of(const std::vector<Call>& calls, const std::string& what) {
  return static_cast<double>(
      std::count_if(calls.begin(), calls.end(), [&](const Call& c) { return c.what == what; }));
}

/// A daemon, on the first of `hosts` or on this one.
class Service {
 public:
  Service(const test::TwoHosts* hosts, const std::string& security)
      : hosts_(hosts), security_(security) {
    std::string dds =
        security.empty() ? "without_security: true" : "security: " + security + "/line-3";
    if (hosts != nullptr) dds += fmt::format(", address: {}, allow_network: true", host());
    const std::string text = test::read_file(daemon_.config_path());
    static_cast<void>(test::demand(
        write_text_file(daemon_.config_path(), fmt::format("{}dds: {{{}}}\n", text, dds)).map([] {
          return true;
        })));
    service_ = std::make_unique<test::Process>(on(0, daemon_.command_line()));
    if (!service_->wait_for_line("ready", kLimit)) fail(service_->standard_error());
  }

  [[nodiscard]] std::string place() const { return fmt::format("{}:{}", host(), daemon_.port()); }
  void learn(std::uint64_t seed = 3) const {
    const std::string batch =
        folder_.write(fmt::format("batch{}.csv", seed), test::virtual_batch_csv(150, seed));
    tell({"submit", "--cell", "cell-7", "--batch", batch, "--watch"});
  }

  /// A client of the other host.
  [[nodiscard]] std::unique_ptr<test::Process> asker(int most_seconds, int requests) const {
    std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(),
                                      "--ask",
                                      host(),
                                      "--ask-port",
                                      std::to_string(daemon_.port()),
                                      "--ask-domain",
                                      std::to_string(daemon_.domain()),
                                      "--seconds",
                                      std::to_string(most_seconds),
                                      "--requests",
                                      std::to_string(requests)};
    if (!security_.empty()) words.insert(words.end(), {"--ask-security", security_ + "/office"});
    return std::make_unique<test::Process>(on(1, std::move(words)));
  }
  [[nodiscard]] std::vector<Call> asked(int most_seconds, int requests) const {
    const auto process = asker(most_seconds, requests);
    if (process->wait(kLimit) != 0) fail(process->standard_error());
    return calls_in(process->standard_output());
  }

 private:
  [[noreturn]] static void fail(const std::string& why) {
    fmt::print(stderr, "{}\n", why);
    std::exit(1);
  }
  [[nodiscard]] std::string host() const {
    return hosts_ != nullptr ? hosts_->address(0) : "127.0.0.1";
  }
  [[nodiscard]] std::vector<std::string> on(std::size_t host, std::vector<std::string> argv) const {
    return hosts_ != nullptr ? hosts_->on(host, std::move(argv)) : argv;
  }
  /// A command beside the daemon. Where a new model is no better, the exit code is 1.
  void tell(std::vector<std::string> words) const {
    words.insert(words.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    words.insert(words.end(), {"--host", place(), "--domain", std::to_string(daemon_.domain())});
    if (!security_.empty()) words.insert(words.end(), {"--security", security_ + "/measuring"});
    const auto done = test::run(on(0, words), kLimit);
    if (done.exit_code.value_or(99) > 1) fail(done.out + done.err);
  }

  const test::TwoHosts* hosts_;
  const std::string security_;
  test::Daemon daemon_;
  test::TemporaryFolder folder_;
  std::unique_ptr<test::Process> service_;
};

const test::LineFaults kBadLine{0.05, milliseconds(50), milliseconds(10)};

bool made(const test::TwoHosts& hosts) {
  if (!hosts.why_not().empty()) fmt::print("skipped: {}\n", hosts.why_not());
  return hosts.why_not().empty();
}

void tell_line(int most_seconds) {
  const test::TwoHosts hosts(kBadLine);
  if (!made(hosts)) return;
  const Service service(&hosts, "");
  service.learn();
  const std::vector<Call> calls = service.asked(most_seconds, 0);
  fmt::print(
      "{} requests over a line that loses 5 % and takes 50 to 60 ms each way: p50 {:.0f}, p99 "
      "{:.0f} ms\n",
      calls.size(), share_of_times(calls, 0.5), share_of_times(calls, 0.99));
  test::tell_figure("bad line: wrong answers", count_of(calls, "wrong"));
  test::tell_figure("bad line: requests without an answer", count_of(calls, "none"));
  test::tell_figure("bad line: p50 of one target, ms", share_of_times(calls, 0.5));
  test::tell_figure("bad line: p99 of one target, ms", share_of_times(calls, 0.99));
}

/// From the end of a cut to the next answer, s, each.
void tell_cuts(int cuts) {
  test::TwoHosts hosts(kBadLine);
  if (!made(hosts)) return;
  const Service service(&hosts, "");
  service.learn();
  double longest = 0, wrong = 0;
  for (int i = 0; i < cuts; ++i) {
    const auto process = service.asker(20, 0);
    hosts.wait_until_carried(hosts.carried() + 200);
    const auto until = hosts.cut_for(seconds(5));
    static_cast<void>(process->wait(kLimit));
    const std::vector<Call> calls = calls_in(process->standard_output());
    const auto next = std::find_if(calls.begin(), calls.end(), [&](const Call& call) {
      return call.what == "right" && call.ended > until.time_since_epoch().count();
    });
    const double took =
        next == calls.end()
            ? 99
            : 1e-9 * static_cast<double>(next->ended - until.time_since_epoch().count());
    fmt::print("cut {}: answered again {:.2f} s after it\n", i + 1, took);
    longest = std::max(longest, took);
    wrong += count_of(calls, "wrong");
  }
  test::tell_figure("cut of 5 s: longest until an answer, s", longest);
  test::tell_figure("cut of 5 s: wrong answers", wrong);
}

/// Certificates as `keys` issues them, in `plant`; false where none can be made.
bool issue(const std::string& keys, const std::string& plant) {
  bool issued = test::run({"/bin/bash", keys, "init", plant}).exit_code == 0;
  for (const auto& [role, name] :
       {std::pair("server", "line-3"), {"cam", "office"}, {"engineer", "measuring"}})
    issued = issued && test::run({"/bin/bash", keys, "issue", plant, role, name}).exit_code == 0;
  return issued;
}

/// The script whose plants encrypt what is said and sign no message.
std::string unsigning(const test::TemporaryFolder& folder, const std::string& keys) {
  constexpr std::string_view kSigns = "<rtps_protection_kind>SIGN<";
  std::string text = test::read_file(keys);
  const std::size_t at = text.find(kSigns);
  if (at == std::string::npos) std::abort();
  text.replace(at, kSigns.size(), "<rtps_protection_kind>NONE<");
  return folder.write("keys", text);
}

void tell_security(int requests) {
  const test::TemporaryFolder folder;
  const std::string keys = TRAMMEL_SOURCE_DIR "/deploy/security/keys";
  const std::string plant = folder.file("plant"), unsigned_plant = folder.file("unsigned");
  if (!issue(keys, plant) || !issue(unsigning(folder, keys), unsigned_plant))
    return static_cast<void>(fmt::print("skipped: no certificates can be made here\n"));
  const std::array<std::string, 3> participants = {"", unsigned_plant + "/participants",
                                                   plant + "/participants"};
  std::vector<double> over_plain, signing;
  for (int round = 0; round < 3; ++round) {
    std::array<double, 3> p50{};
    for (std::size_t k = 0; k < participants.size(); ++k) {
      const Service service(nullptr, participants.at(k));
      service.learn();
      p50.at(k) = share_of_times(service.asked(100, requests), 0.5);
    }
    fmt::print("one target, p50: plain {:.3f} ms, encrypted {:.3f} ms, signed too {:.3f} ms\n",
               p50[0], p50[1], p50[2]);
    over_plain.push_back(p50[2] / p50[0]);
    signing.push_back(p50[2] / p50[1]);
  }
  std::sort(over_plain.begin(), over_plain.end());
  std::sort(signing.begin(), signing.end());
  test::tell_figure("security: p50 of one target over plain", over_plain[1]);
  test::tell_figure("security: p50 of one target, messages signed over not signed", signing[1]);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What a bad line and certificates cost.");
  trammel::Asked asked;
  std::string only;
  int cuts = 10;
  asked.most_seconds = 30;
  app.add_option("--only", only);
  app.add_option("--cuts", cuts);
  app.add_option("--seconds", asked.most_seconds);
  app.add_option("--requests", asked.requests);
  app.add_option("--ask", asked.host);
  app.add_option("--ask-port", asked.port);
  app.add_option("--ask-domain", asked.domain);
  app.add_option("--ask-security", asked.security);
  CLI11_PARSE(app, argc, argv);
  if (!asked.host.empty()) return trammel::ask(asked);
  if (only.empty() || only == "line") trammel::tell_line(asked.most_seconds);
  if (only.empty() || only == "cut") trammel::tell_cuts(cuts);
  if (only.empty() || only == "security") trammel::tell_security(2000);
  return 0;
}
