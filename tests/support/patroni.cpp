#include "tests/support/patroni.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "server/store/store_init.h"

namespace trammel::test {
namespace {

constexpr std::chrono::seconds kPatience{300};
constexpr const char* kScript = TRAMMEL_SOURCE_DIR "/deploy/patroni/cluster";

}  // namespace

Patroni::Patroni() {
  for (const char* program :
       {"/usr/bin/patroni", "/usr/bin/etcd", "/usr/bin/psql", "/usr/sbin/ip"}) {
    if (::access(program, X_OK) != 0)
      why_not_ = fmt::format("{} is not installed (deploy/dependencies)", program);
  }
  if (!why_not_.empty()) return;
  outside_ = ::open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
  if (::unshare(CLONE_NEWNET) != 0) {
    why_not_ = "network namespaces cannot be made here: that takes root";
    return;
  }
  // TERM lets it end its children; killed together with this process it could not.
  cluster_.emplace(std::vector<std::string>{"/usr/bin/setpriv", "--pdeathsig=TERM", kScript, "run",
                                            folder_.path().string()});
  if (!cluster_->wait_for_line("ready: ", kPatience)) why_not_ = cluster_->standard_error();
}

Patroni::~Patroni() {
  if (cluster_) {
    cluster_->signal(SIGTERM);
    static_cast<void>(cluster_->wait(kPatience));
  }
  if (outside_ < 0) return;
  static_cast<void>(::setns(outside_, CLONE_NEWNET));
  ::close(outside_);
}

std::string Patroni::url(const std::string& role, const std::string& database) const {
  return fmt::format(
      "postgresql://{}:only-here@10.201.0.1,10.201.0.2,10.201.0.3/"
      "{}?target_session_attrs=read-write",
      role, database);
}

Finished Patroni::ask(const std::string& what, const std::string& more) const {
  return run({kScript, what, folder_.path().string(), more}, kPatience);
}

std::string Patroni::sql(const std::string& statement) const {
  const Finished said = run({"/usr/bin/psql", url("postgres", "trammel") + "&connect_timeout=2",
                             "-v", "ON_ERROR_STOP=1", "-qAtc", statement},
                            kPatience);
  if (said.exit_code == 0) return said.out;
  fmt::print(stderr, "{}\n", said.err);
  std::abort();
}

std::string Patroni::new_store() {
  const Finished made =
      run({"/usr/bin/psql", url("postgres", "postgres"), "-v", "ON_ERROR_STOP=1", "-qc",
           "CREATE ROLE trammel LOGIN PASSWORD 'only-here'", "-c", "CREATE DATABASE trammel"},
          kPatience);
  const Status ready =
      made.exit_code == 0 ? init_store(url("postgres", "trammel"), "trammel") : Status();
  if (made.exit_code == 0 && ready) return url("trammel", "trammel");
  fmt::print(stderr, "{}{}\n", made.err, ready ? "" : sentence(ready.error()));
  std::abort();
}

int Patroni::primary() const { return std::atoi(ask("primary").out.c_str()); }

void Patroni::act(const std::string& what, int host) const {
  const Finished done = ask(what, std::to_string(host));
  if (done.exit_code == 0) return;
  fmt::print(stderr, "{} {}: {}\n", what, host, done.err);
  std::abort();
}

bool Patroni::wait_until_whole() const { return ask("whole").exit_code == 0; }

}  // namespace trammel::test
