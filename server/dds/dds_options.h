#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/base/host_port.h"
#include "server/dds/records/record_options.h"

namespace trammel {

/// Domain, address, ports and name of the service on DDS. The default talks to this host only.
struct DdsOptions {
  std::uint32_t domain = 0;
  std::string address = "127.0.0.1";  ///< IPv4 of the only interface that is used
  std::uint16_t port = 17500;  ///< UDP; clients look for the server here; one server per port
  std::vector<HostPort>
      discovery_servers;  ///< servers that tell clients of `address` and `port`; position = number
  std::string security;   ///< folder of idl/transport/security.h; empty: everybody is believed
  std::string server_id =
      "trammel";  ///< unique among servers; 1 to 64 letters, digits, `.`, `_`, `-`
  std::string program_version = "0.1.0";
  int compute_workers = 2;  ///< threads for PredictError, and as many for CorrectTarget
  int max_clients = 256;    ///< reply channels at a time; with more clients, idle ones take turns
  int client_requests =
      64;              ///< requests of one client that may wait: predictions, corrections, others
  int client_mb = 64;  ///< memory of all of them together
  int queued_requests = 4096;  ///< requests of all clients that may wait, likewise
  int queued_mb = 256;         ///< memory of all of them together
  RecordOptions record = {};   ///< of predictions and corrections
  double cell_share = 0.5;     ///< of these two limits, for the requests of one cell
  bool local_calls =
      false;          ///< true: a gateway in this process asks, too (gateway/service_calls.h)
  bool ros2 = false;  ///< true: ROS 2 nodes are answered, too (idl/transport/ros2.h); not together
                      ///< with `security`
};

}  // namespace trammel
