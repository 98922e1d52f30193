#include "tests/support/postgres.h"

#include <fmt/format.h>
#include <pwd.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "server/store/store_init.h"
#include "tests/support/computing_child.h"

namespace trammel::test {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{60};

[[noreturn]] void give_up(const std::string& why) {
  fmt::print(stderr, "PostgreSQL for the tests: {}\n", why);
  std::abort();
}

/// The newest one that is installed.
std::string program(const std::string& name) {
  std::string newest;
  std::error_code error;
  for (const auto& version : fs::directory_iterator("/usr/lib/postgresql", error))
    newest = std::max(newest, (version.path() / "bin").string());
  if (newest.empty()) give_up("is not installed (deploy/dependencies)");
  return newest + "/" + name;
}

/// It refuses to run as root.
std::vector<std::string> as_its_user(std::vector<std::string> command) {
  if (::geteuid() != 0) return command;
  std::vector<std::string> whole = {"/usr/bin/setpriv", "--reuid=postgres", "--regid=postgres", "--init-groups",
                                    "--pdeathsig=QUIT"};
  whole.insert(whole.end(), command.begin(), command.end());
  return whole;
}

std::vector<pid_t> children_of(pid_t parent) {
  std::ifstream listed(fmt::format("/proc/{0}/task/{0}/children", parent));
  return {std::istream_iterator<pid_t>(listed), {}};
}

void give_to_its_user(const fs::path& folder) {
  if (::geteuid() != 0) return;
  const passwd* user = ::getpwnam("postgres");
  if (user == nullptr || ::chown(folder.c_str(), user->pw_uid, user->pw_gid) != 0) give_up("has no user");
}

}  // namespace

Postgres& Postgres::of_program() {
  static Postgres one;
  return one;
}

Postgres::Postgres(Disk disk) : disk_(disk) {
  give_to_its_user(folder_.path());
  const Finished made = run(as_its_user({program("initdb"), "-D", data(), "-U", "postgres", "-A", "trust", "-E", "UTF8",
                                         "--locale=C.UTF-8", "--no-sync"}),
                            kPatience);
  if (made.exit_code != 0) give_up(made.err);
  folder_.write("data/pg_hba.conf", "local all needs_password scram-sha-256\nlocal all all trust\n");
  start();
  sql(url("postgres"), "CREATE ROLE needs_password LOGIN PASSWORD 'right'");
  if (disk_ == Disk::kSmall)
    sql(url("postgres"), fmt::format("CREATE TABLESPACE small LOCATION '{}/space'", small_disk()));
  sql(url("postgres"), "CREATE DATABASE template_store");
  if (const Status ready = init_store(url("template_store")); !ready) give_up(sentence(ready.error()));
}

Postgres::~Postgres() { stop(); }

void Postgres::start() { start_until("ready to accept connections"); }

void Postgres::start_until(const std::string& line) {
  auto command =
      as_its_user({program("postgres"), "-D", data(), "-k", folder_.path().string(), "-c", "listen_addresses=", "-c",
                   disk_ == Disk::kWaitedFor ? "fsync=on" : "fsync=off", "-c", "max_connections=60"});
  if (disk_ == Disk::kSmall) {
    // Mounted for the server alone: it goes with it.
    constexpr const char* kMounted =
        "set -e; mkdir -p \"$0\"; mount -t tmpfs -o size=64m tmpfs \"$0\"; mkdir \"$0/space\"; "
        "chown -R postgres \"$0\"; head -c 16M /dev/zero >\"$0/ballast\"; exec \"$@\"";
    command.insert(command.begin(), {"/usr/bin/unshare", "--mount", "/bin/bash", "-c", kMounted, small_disk()});
  }
  server_.emplace(command);
  if (!server_->wait_for_line(line, kPatience)) give_up(server_->standard_error());
}

void Postgres::become_standby() {
  stop();
  folder_.write("data/standby.signal", "");
  start_until("ready to accept read-only connections");
}

void Postgres::make_room() const { fs::remove(fmt::format("/proc/{}/root{}/ballast", server_->pid(), small_disk())); }

void Postgres::stop() {
  if (!server_) return;
  server_->signal(SIGQUIT);
  static_cast<void>(server_->wait(kPatience));
  server_.reset();
}

void Postgres::kill() {
  const std::vector<pid_t> children = children_of(server_->pid());
  server_->signal(SIGKILL);
  static_cast<void>(server_->wait(kPatience));
  server_.reset();
  for (const pid_t child : children) {
    if (!Watched(child).ends(kPatience)) give_up("a process of the one that was killed does not end");
  }
}

void Postgres::freeze(bool frozen) const {
  const int number = frozen ? SIGSTOP : SIGCONT;
  if (frozen) server_->signal(number);
  for (const pid_t child : children_of(server_->pid())) ::kill(child, number);
  if (!frozen) server_->signal(number);
}

std::string Postgres::url(const std::string& database, const std::string& role) const {
  return fmt::format("postgresql://{}@/{}?host={}", role, database, folder_.path().string());
}

std::string Postgres::sql(const std::string& url, const std::string& statement) const {
  const Finished said = run({program("psql"), url, "-v", "ON_ERROR_STOP=1", "-qAtc", statement}, kPatience);
  if (said.exit_code != 0) give_up(said.err);
  return said.out;
}

std::string Postgres::new_database() {
  const std::string name = fmt::format("test_{}", ++databases_);
  sql(url("postgres"), "CREATE DATABASE " + name);
  return url(name);
}

std::string Postgres::new_store(const std::string& more) {
  const std::string name = fmt::format("test_{}", ++databases_);
  sql(url("postgres"), fmt::format("CREATE DATABASE {} TEMPLATE template_store {}", name, more));
  // A store of its own, and no copy of the template.
  sql(url(name), "UPDATE store_identity SET id = md5(random()::text)");
  return url(name);
}

}  // namespace trammel::test
