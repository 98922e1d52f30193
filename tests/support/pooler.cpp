#include "tests/support/pooler.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

namespace trammel::test {
namespace {

constexpr std::chrono::seconds kPoolerPatience{60};

}  // namespace

Pooler::Pooler(const Postgres& server) {
  const std::string url = server.url("postgres");
  server_folder_ = url.substr(url.find("host=") + 5);
  folder_.write("users", "\"postgres\" \"\"\n");
  const std::string file = folder_.write(
      "pgbouncer.ini",
      fmt::format(
          "[databases]\n* = host={}\n[pgbouncer]\npool_mode = transaction\ndefault_pool_size = 2\n"
          "listen_addr =\nlisten_port = 6432\nunix_socket_dir = {}\nauth_type = trust\nauth_file = "
          "{}\n",
          server_folder_, folder_.path().string(), folder_.file("users")));
  std::vector<std::string> command = {"/usr/sbin/pgbouncer", file};
  if (::geteuid() == 0) {  // the pooler refuses to run as root
    static_cast<void>(run({"/bin/chown", "-R", "postgres", folder_.path().string()}));
    command.insert(command.begin(), {"/usr/bin/setpriv", "--reuid=postgres", "--regid=postgres",
                                     "--init-groups", "--pdeathsig=KILL"});
  }
  pooler_.emplace(command);
  if (pooler_->wait_for_line("process up", kPoolerPatience)) return;
  fmt::print(stderr, "pgbouncer for the tests: {}\n", pooler_->standard_error());
  std::abort();
}

std::string Pooler::through(std::string url) const {
  const std::size_t at = url.find(server_folder_);
  return url.replace(at, server_folder_.size(), folder_.path().string()) + "&port=6432";
}

}  // namespace trammel::test
