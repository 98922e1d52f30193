// Shows the cells of a running service: service PORT DOMAIN
#include "trammel/service.h"

#include <cstdio>
#include <cstdlib>
#include <utility>

using namespace trammel::api;

int main(int count, char** arguments) {
  SessionOptions options;
  if (count > 1) options.ports = {static_cast<std::uint16_t>(std::atoi(arguments[1]))};
  if (count > 2) options.domain = static_cast<std::uint32_t>(std::atoi(arguments[2]));
  options.timeout = std::chrono::seconds(30);
  const Result<Session> session = Session::open(options);
  if (!session) return std::puts(session.error().sentence.c_str()), 4;

  const auto servers = session->servers();
  if (!servers) return std::puts(servers.error().sentence.c_str()), 4;
  for (const Server& server : *servers) {
    for (const std::string& cell : server.cells) {
      const std::vector<double> joints_deg(6, 0.0);
      const auto answer = session->predict({.cell = cell, .context = {}}, joints_deg);
      const std::string said =
          answer ? "model " + std::to_string(answer->model.version) : to_text(answer.error().code);
      std::printf("%s: %s\n", cell.c_str(), said.c_str());
    }
  }
}
