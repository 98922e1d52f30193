#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "clients/cli/commands/commands.h"
#include "clients/cli/service/named_places.h"
#include "clients/cli/terminal/command_tree.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/neighbours.h"
#include "server/base/part_file.h"
#include "server/base/plain_text.h"
#include "server/store/commit_safety.h"
#include "server/store/store.h"
#include "server/store/store_check.h"
#include "server/store/store_place.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

constexpr double kRoomNeededMb = 200;              // of the store's disk
constexpr std::int64_t kEarliest = 1'700'000'000;  // Unix time, s: no clock of today is before

struct DoctorArguments {
  std::string store, json;
  ServiceOptions service;
};

enum class State { kGood, kNote, kBad };

/// A finding of one check, and its remedy.
struct Found {
  std::string check;
  State state = State::kGood;
  std::string what, next;
};

const char* name_of(State state) {
  return state == State::kGood ? "good" : state == State::kNote ? "note" : "bad";
}

/// A UDP socket that is closed with its scope.
class Udp {
 public:
  Udp() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}
  ~Udp() {
    if (socket_ >= 0) ::close(socket_);
  }
  Udp(const Udp&) = delete;
  Udp& operator=(const Udp&) = delete;

  /// 0, or why it cannot be bound.
  [[nodiscard]] int bind(const std::string& host, std::uint16_t port) {
    place_.sin_family = AF_INET;
    place_.sin_port = htons(port);
    if (::inet_pton(AF_INET, host.c_str(), &place_.sin_addr) != 1) return EINVAL;
    return ::bind(socket_, reinterpret_cast<const sockaddr*>(&place_), sizeof place_) == 0 ? 0
                                                                                           : errno;
  }
  /// True if a datagram sent to itself comes back.
  [[nodiscard]] bool hears_itself() {
    socklen_t size = sizeof place_;
    if (::getsockname(socket_, reinterpret_cast<sockaddr*>(&place_), &size) != 0) return false;
    const char out = 'x';
    if (::sendto(socket_, &out, 1, 0, reinterpret_cast<const sockaddr*>(&place_), sizeof place_) !=
        1)
      return false;
    pollfd readable{socket_, POLLIN, 0};
    char in = 0;
    return ::poll(&readable, 1, 1000) == 1 && ::recv(socket_, &in, 1, 0) == 1;
  }

 private:
  int socket_;
  sockaddr_in place_{};
};

Found network(const std::string& host) {
  const auto own = own_address_towards(host);
  if (!own) return {"network", State::kBad, own.error().message, own.error().next};
  if (*own != host)
    return {"network", State::kGood, fmt::format("{} is reached from {}", host, *own), ""};
  Udp udp;
  const int why = udp.bind(host, 0);
  if (why != 0) {
    return {"network", State::kBad,
            fmt::format("{} cannot be used: {}", shown(host), std::strerror(why)),
            "name an address of this host by --host; is the interface up? ip address"};
  }
  if (!udp.hears_itself())
    return {"network", State::kBad, fmt::format("a datagram to {} does not arrive", host),
            "does a firewall drop UDP on this interface? nft list ruleset"};
  return {"network", State::kGood, fmt::format("datagrams arrive on {}", host), ""};
}

Found port(const std::string& host, std::uint16_t number) {
  const std::string check = fmt::format("port {}", number);
  if (held_by_server(host, number)) return {check, State::kGood, "a trammel server holds it", ""};
  Udp udp;
  const int why = udp.bind(host, number);
  if (why == 0)
    return {check, State::kNote, "free: no server listens here",
            "start one: trammeld --config SERVER.yaml; or name its port by --port"};
  return {check, State::kBad, fmt::format("taken by another program: {}", std::strerror(why)),
          fmt::format("who is it? ss -ulnp 'sport = :{}'; give the server another port (key port)",
                      number)};
}

Found version_of(const client::ServerStatus& server) {
  const std::string check = "server " + shown(server.server_id);
  if (!server.trouble.empty())
    return {check, State::kBad, shown(server.trouble),
            "trammel status tells more; its log says since when"};
  if (server.version != TRAMMEL_VERSION) {
    return {
        check, State::kNote,
        fmt::format("version {}, this command line is {}", shown(server.version), TRAMMEL_VERSION),
        "bring both to one version"};
  }
  return {check, State::kGood,
          fmt::format("version {} as this command line, {} cells, up {:.0f} s",
                      shown(server.version), server.cells.size(), server.uptime_s),
          ""};
}

void look_at_servers(const ServiceOptions& options, const std::vector<HostPort>& places,
                     std::vector<Found>& found) {
  const bool any = std::any_of(places.begin(), places.end(), [](const HostPort& place) {
    return !is_of_this_host(place) || held_by_server(place.address, place.port);
  });
  if (!any && options.discovery_servers.empty()) return;  // the ports say so
  const auto session = open_session(options);
  const auto servers =
      session ? (*session)->servers()
              : Result<std::vector<client::ServerStatus>>(tl::make_unexpected(session.error()));
  if (!servers) {
    const std::string hung =
        "its port is held, and it does not answer: is it of another --domain, or hung? read its "
        "log";
    found.push_back(
        {"servers", State::kBad, servers.error().message, any ? hung : servers.error().next});
    return;
  }
  for (const client::ServerStatus& server : *servers) found.push_back(version_of(server));
}

Found certificates(const std::string& folder, const std::vector<HostPort>& places) {
  const bool all_here = std::all_of(places.begin(), places.end(), is_of_this_host);
  if (folder.empty() && all_here)
    return {"certificates", State::kGood, "none are used: traffic stays on this host", ""};
  if (folder.empty())
    return {"certificates", State::kNote, "none are used, and traffic leaves this host",
            "is the service without security? else name your folder by --security"};
  const auto subject = client::check_security(folder);
  if (!subject)
    return {"certificates", State::kBad, sentence(subject.error()), subject.error().next};
  return {"certificates", State::kGood, "of " + shown(*subject), ""};
}

/// Whoever is on this host reaches what listens on 127.0.0.1.
Found others_on_host(const std::string& folder, const std::vector<HostPort>& places) {
  const bool any_here = std::any_of(places.begin(), places.end(), is_of_this_host);
  const Neighbours found = neighbours();
  if (found.may_log_in.empty())
    return {"neighbours", State::kGood, "nobody else may log in to this host", ""};
  const std::string who =
      found.logged_in.empty()
          ? fmt::format("may log in: {}",
                        shown(fmt::format("{}", fmt::join(found.may_log_in, ", "))))
          : fmt::format("logged in: {}",
                        shown(fmt::format("{}", fmt::join(found.logged_in, ", "))));
  if (!any_here) return {"neighbours", State::kGood, who + "; the service is on another host", ""};
  if (!folder.empty()) return {"neighbours", State::kGood, who + "; certificates are used", ""};
  return {"neighbours", State::kNote,
          who + ": without certificates and tokens they may ask a service here for everything",
          "where they should not: deploy/security/README.md, \"Several people on one host\""};
}

Found clock() {
  const auto now = std::chrono::duration_cast<std::chrono::seconds>(
                       std::chrono::system_clock::now().time_since_epoch())
                       .count();
  if (now < kEarliest)
    return {"clock", State::kBad, "it is years behind: models and audit trail would be dated wrong",
            "set it: timedatectl set-time, or set-ntp true"};
  timex about{};
  if (::adjtimex(&about) == TIME_ERROR)
    return {"clock", State::kNote,
            "not synchronised: times of tracker and controller may not fit each other",
            "synchronise it: timedatectl set-ntp true"};
  return {"clock", State::kGood, "synchronised", ""};
}

/// Incomplete files of dead processes in the named folders.
Found leftovers(const std::vector<fs::path>& folders) {
  std::vector<std::string> left;
  for (const fs::path& folder : folders) {
    for (const fs::path& part : leftover_parts(folder)) left.push_back(shown(part.string()));
  }
  std::sort(left.begin(), left.end());
  if (left.empty())
    return {"leftovers", State::kGood, "no half-written files of processes that are gone", ""};
  return {"leftovers", State::kNote,
          fmt::format("half-written by processes that are gone: {}", fmt::join(left, ", ")),
          fmt::format("delete them: rm {}", fmt::join(left, " "))};
}

/// Reports which failures an acknowledged change survives with this record.
void look_at_record(const std::string& url, std::vector<Found>& found) {
  const auto store = Store::open(url);
  const RecordState record = store ? (*store)->record() : RecordState();
  if (!record.survives.empty()) {
    found.push_back({"record", record.worry.empty() ? State::kGood : State::kNote,
                     "an acknowledged change survives " + record.survives, record.worry});
  }
  if (const std::string missing = missing_watchdog(); !missing.empty())
    found.push_back({"watchdog", State::kNote, missing.substr(0, missing.find("; ")),
                     missing.substr(missing.find("; ") + 2)});
}

void look_at_store(const std::string& path, std::vector<Found>& found) {
  const Status usable = check_store(path);
  const bool in_use = !usable && usable.error().code == ErrorCode::kConflict;
  if (!usable && !in_use) {
    Error why = usable.error();
    std::string next = std::exchange(why.next, "");
    if (next.empty()) next = "name the key store of the server file; its folder must exist";
    found.push_back({"store", State::kBad, sentence(why), std::move(next)});
    return;
  }
  found.push_back({"store", State::kGood, in_use ? "in use by a server" : "could be opened", ""});
  if (is_postgres_url(path)) return look_at_record(path, found);  // its disk is another host's
  struct statvfs disk {};
  const fs::path folder =
      fs::path(path).has_parent_path() ? fs::path(path).parent_path() : fs::path(".");
  if (::statvfs(folder.c_str(), &disk) != 0) return;
  const double free_mb =
      static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) / 1e6;
  const bool little = free_mb < kRoomNeededMb;
  found.push_back({"disk", little ? State::kBad : State::kGood,
                   fmt::format("{:.0f} MB free for the store", free_mb),
                   little ? fmt::format("make room in {}: {:.0f} MB at least",
                                        shown(folder.string()), kRoomNeededMb)
                          : ""});
}

/// The text in lines beside `left`; later lines are indented by the width of `left`.
std::string beside(const std::string& left, const std::string& text) {
  const std::string filled = std::string(left.size() - 1, '.') + " " + text;
  return left + wrapped(filled, left.size()).substr(left.size()) + "\n";
}

std::string as_text(const std::vector<Found>& found) {
  std::size_t width = 0;
  for (const Found& one : found) width = std::max(width, one.check.size());
  std::string text;
  for (const Found& one : found) {
    const std::string look = fmt::format("{:<6}{:<{}}  ", name_of(one.state), one.check, width);
    text += beside(look, one.what);
    if (!one.next.empty()) text += beside(std::string(look.size(), ' '), one.next);
  }
  return text;
}

Result<Extent> examine(const DoctorArguments& arguments) {
  const ServiceOptions& service = arguments.service;
  const auto places = TRY(places_of(service));
  std::vector<Found> found = {{"version", State::kGood, TRAMMEL_VERSION, ""}};
  std::set<std::string> hosts;
  for (const HostPort& place : places) {
    if (hosts.insert(place.address).second) found.push_back(network(place.address));
  }
  for (const HostPort& place : places) {
    if (is_of_this_host(place)) found.push_back(port(place.address, place.port));
  }
  look_at_servers(service, places, found);
  found.push_back(clock());
  std::vector<fs::path> folders = {"."};
  if (!arguments.store.empty()) {
    look_at_store(arguments.store, found);
    if (fs::path(arguments.store).has_parent_path())
      folders.push_back(fs::path(arguments.store).parent_path());
  }
  found.push_back(leftovers(folders));
  found.push_back(certificates(service.security, places));
  found.push_back(others_on_host(service.security, places));
  tell(as_text(found), {arguments.json});
  nlohmann::ordered_json checks = nlohmann::ordered_json::array();
  for (const Found& one : found)
    checks.push_back({{"check", one.check},
                      {"state", name_of(one.state)},
                      {"what", one.what},
                      {"next", one.next}});
  TRY(write_json(arguments.json, {{"version", TRAMMEL_VERSION}, {"checks", std::move(checks)}}));
  const bool bad = std::any_of(found.begin(), found.end(),
                               [](const Found& one) { return one.state == State::kBad; });
  return bad ? Extent::kPart : Extent::kAll;
}

}  // namespace

void add_doctor_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<DoctorArguments>();
  arguments->service.timeout_s = 2;
  CLI::App* command = app.add_subcommand(
      "doctor",
      "Look at this machine for what keeps a service from working, and say what to do about it");
  command
      ->add_option("--store", arguments->store,
                   "A server's store (its key store), a file or a URL, to look at it, too")
      ->type_name("STORE");
  add_json_option(*command, arguments->json);
  add_options_of_service_command(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return examine(*arguments); }; });
}

}  // namespace trammel::cli
