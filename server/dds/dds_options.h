#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace trammel {

/// Where and as whom the service appears on DDS. The default talks to this host only.
struct DdsOptions {
  std::uint32_t domain = 0;
  std::string address = "127.0.0.1";      ///< IPv4 of the only interface that is used
  std::uint16_t port = 17500;             ///< UDP; clients look for the server here. One server a port
  std::vector<std::uint16_t> peer_ports;  ///< of replicas on `address`
  std::string server_id = "trammel";      ///< unique among replicas; 1 to 64 letters, digits, `.`, `_`, `-`
  std::string program_version = "0.1.0";
  int compute_workers = 2;  ///< threads for PredictError and as many for CorrectTarget; every other operation has one
  int max_clients = 128;    ///< with a reply channel at a time; the one that has been silent longest loses its own
};

}  // namespace trammel
