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
#include <sstream>
#include <vector>

#include "server/store/store_init.h"
#include "tests/support/computing_child.h"

namespace trammel::test {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPostgresPatience{60};

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
  std::vector<std::string> whole = {"/usr/bin/setpriv", "--reuid=postgres", "--regid=postgres",
                                    "--init-groups", "--pdeathsig=QUIT"};
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
  if (user == nullptr || ::chown(folder.c_str(), user->pw_uid, user->pw_gid) != 0)
    give_up("has no user");
}

}  // namespace

Postgres& Postgres::of_program() {
  static Postgres one;
  return one;
}

Postgres::Postgres(Disk disk)
    : folder_(disk == Disk::kOwn ? TemporaryFolder::Place::kInMemory
                                 : TemporaryFolder::Place::kDisk),
      disk_(disk) {
  give_to_its_user(folder_.path());
  const Finished made = run(as_its_user({program("initdb"), "-D", data(), "-U", "postgres", "-A",
                                         "trust", "-E", "UTF8", "--locale=C.UTF-8", "--no-sync"}),
                            kPostgresPatience);
  if (made.exit_code != 0) give_up(made.err);
  folder_.write("data/pg_hba.conf",
                "local all needs_password scram-sha-256\nlocal all all trust\n");
  start();
  sql(url("postgres"), "CREATE ROLE needs_password LOGIN PASSWORD 'right'");
  if (disk_ == Disk::kSmall)
    sql(url("postgres"), fmt::format("CREATE TABLESPACE small LOCATION '{}/space'", small_disk()));
  sql(url("postgres"), "CREATE DATABASE template_store");
  if (const Status ready = init_store(url("template_store")); !ready)
    give_up(sentence(ready.error()));
}

Postgres::~Postgres() { stop(); }

void Postgres::start() { start_until("ready to accept connections"); }

void Postgres::start_until(const std::string& line) {
  auto command =
      as_its_user({program("postgres"), "-D", data(), "-k", folder_.path().string(), "-c",
                   "listen_addresses=", "-c", disk_ == Disk::kWaitedFor ? "fsync=on" : "fsync=off",
                   "-c", "max_connections=60"});
  if (port_ != 0)
    command.insert(command.end(), {"-c", "listen_addresses=127.0.0.1", "-c", "ssl=on", "-p",
                                   std::to_string(port_)});
  if (disk_ == Disk::kSmall) {
    // A mount for the server alone, which ends with it.
    constexpr const char* kMounted =
        "set -e; mkdir -p \"$0\"; mount -t tmpfs -o size=64m tmpfs \"$0\"; mkdir \"$0/space\"; "
        "chown -R postgres \"$0\"; head -c 16M /dev/zero >\"$0/ballast\"; exec \"$@\"";
    command.insert(command.begin(),
                   {"/usr/bin/unshare", "--mount", "/bin/bash", "-c", kMounted, small_disk()});
  }
  server_.emplace(command);
  if (!server_->wait_for_line(line, kPostgresPatience)) give_up(server_->standard_error());
}

void Postgres::become_standby() {
  stop();
  folder_.write("data/standby.signal", "");
  start_until("ready to accept read-only connections");
}

void Postgres::make_room() const {
  fs::remove(fmt::format("/proc/{}/root{}/ballast", server_->pid(), small_disk()));
}

void Postgres::stop() {
  if (!server_) return;
  server_->signal(SIGQUIT);
  static_cast<void>(server_->wait(kPostgresPatience));
  server_.reset();
}

void Postgres::kill() {
  const std::vector<pid_t> children = children_of(server_->pid());
  server_->signal(SIGKILL);
  static_cast<void>(server_->wait(kPostgresPatience));
  server_.reset();
  for (const pid_t child : children) {
    if (!Watched(child).ends(kPostgresPatience))
      give_up("a process of the one that was killed does not end");
  }
}

void Postgres::freeze(bool frozen) const {
  const int number = frozen ? SIGSTOP : SIGCONT;
  if (frozen) server_->signal(number);
  for (const pid_t child : children_of(server_->pid())) ::kill(child, number);
  if (!frozen) server_->signal(number);
}

std::string Postgres::url(const std::string& database, const std::string& role) const {
  return fmt::format("postgresql://{}@/{}?host={}{}", role, database, folder_.path().string(),
                     port_ == 0 ? "" : fmt::format("&port={}", port_));
}

void Postgres::take_certificates(std::uint16_t port) {
  constexpr const char* kMake =
      "set -e; mkdir \"$0\"; cd \"$0\"; ec='-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 "
      "-nodes'; for ca in ca other-ca; do openssl req -x509 $ec -keyout $ca.key -out $ca.crt -days "
      "2 -subj /CN=$ca; done; sign() { openssl req $ec -keyout $1.key -out $1.csr -subj /CN=$2 "
      "-addext subjectAltName=DNS:$2; openssl x509 -req -in $1.csr -CA ca.crt -CAkey ca.key "
      "-CAcreateserial -copy_extensions copy -days 2 -out $1.crt; }; sign server localhost; sign "
      "keeper keeper; cp server.crt server.key ../data; cp ca.crt ../data/root.crt; chmod 600 "
      "../data/server.key";
  const Finished made = run({"/bin/bash", "-c", kMake, certificates()}, kPostgresPatience);
  if (made.exit_code != 0) give_up(made.err);
  for (const char* file : {"data/server.crt", "data/server.key", "data/root.crt"})
    give_to_its_user(folder_.file(file));
  stop();
  port_ = port;
  folder_.write("data/pg_hba.conf", "local all all trust\nhostssl all all 127.0.0.1/32 cert\n");
  folder_.write("data/postgresql.auto.conf", "ssl_ca_file = 'root.crt'\n");
  start();
}

std::string Postgres::certified_url(const std::string& database, const std::string& role) const {
  return fmt::format(
      "postgresql://{}@localhost:{}/{}?sslmode=verify-full&sslrootcert={}/ca.crt&sslcert={}/"
      "keeper.crt&sslkey={}/keeper.key",
      role, port_, database, certificates(), certificates(), certificates());
}

std::string Postgres::sql(const std::string& url, const std::string& statement) const {
  const Finished said =
      run({program("psql"), url, "-v", "ON_ERROR_STOP=1", "-qAtc", statement}, kPostgresPatience);
  if (said.exit_code != 0) give_up(said.err);
  return said.out;
}

LockedTable::LockedTable(const std::string& url, const std::string& table, const std::string& mode)
    : psql_({program("psql"), url, "-v", "ON_ERROR_STOP=1", "-c", "BEGIN", "-c",
             fmt::format("LOCK TABLE {} IN {} MODE", table, mode), "-c", "SELECT 'locked'", "-c",
             "SELECT pg_sleep(600)"}) {
  if (!psql_.wait_for_line("locked", kPostgresPatience)) give_up(psql_.standard_error());
}

LockedTable::~LockedTable() {
  psql_.signal(SIGINT);  // a server does not notice the end of its client while it sleeps
  static_cast<void>(psql_.wait(kPostgresPatience));
}

void Postgres::write_down(const std::string& url) const {
  const std::string name = sql(url, "SELECT current_database()");
  sql(url,
      fmt::format("ALTER DATABASE {} SET log_statement = 'all'", name.substr(0, name.find('\n'))));
}

std::vector<std::string> Postgres::asked() {
  const std::string mark = fmt::format("SELECT 'mark {}'", ++marks_);
  sql(url("postgres") + "&options=-clog_statement%3Dall", mark);
  if (!server_->wait_for_line(mark, kPostgresPatience))
    give_up("does not write down what it is asked");
  const std::string log = server_->standard_error();
  std::vector<std::string> asked;
  std::istringstream lines(log.substr(read_of_log_));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t simple = line.find("LOG:  statement: "), bound = line.find("LOG:  execute ");
    if (simple == std::string::npos && bound == std::string::npos) continue;
    asked.push_back(line.substr(line.find(": ", line.find("LOG:  ") + 6) + 2));
  }
  read_of_log_ = log.size();
  std::erase_if(asked,
                [](const std::string& text) { return text.find("'mark ") != std::string::npos; });
  return asked;
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
