#include "clients/cli/service/named_places.h"

#include <algorithm>
#include <fstream>

namespace trammel::cli {

bool is_of_this_host(const HostPort& place) {
  const std::vector<std::string> own = own_addresses();
  return std::find(own.begin(), own.end(), place.address) != own.end();
}

bool held_by_server(const std::string& host, std::uint16_t port) {
  std::ifstream sockets("/proc/net/unix");
  const std::string wanted = fmt::format("@trammel-dds-{}-{}", host, port);
  for (std::string line; std::getline(sockets, line);) {
    if (line.ends_with(wanted)) return true;
  }
  return false;
}

std::vector<std::string> silent_servers(const ServiceOptions& service, std::size_t answering) {
  const auto places = places_of(service);
  if (!places || places->size() <= answering) return {};
  std::vector<std::string> silent, unclear;
  for (const HostPort& place : *places) {
    const std::string name = fmt::format("{}:{}", place.address, place.port);
    if (is_of_this_host(place) && !held_by_server(place.address, place.port)) {
      silent.push_back(fmt::format("not reachable: {}, no server holds this port", name));
    } else {
      unclear.push_back(name);
    }
  }
  if (unclear.size() > answering)
    silent.push_back(fmt::format("not reachable: {} of {}; trammel doctor says what is in the way",
                                 unclear.size() - answering, fmt::join(unclear, ", ")));
  return silent;
}

}  // namespace trammel::cli
