#pragma once

#include <cstdint>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// Reserves a UDP port of this host, or a name, for one server. DDS itself would silently give a
/// second server another port, where no client looks. The reservation ends with the process, even
/// after a crash, and leaves no file.
class PortLock {
 public:
  /// Refuses (kConflict) a port that another server, or any program, uses on `address`; (kUsage) an
  /// address that this host does not have.
  [[nodiscard]] static Result<PortLock> take(const std::string& address, std::uint16_t port);
  /// Reserves the name of a server in a domain for the lifetime of the lock. Refuses (kConflict) a
  /// name that another server of this host has, since clients that ask for it would be answered
  /// twice.
  [[nodiscard]] static Result<PortLock> take_name(std::uint32_t domain, const std::string& server);
  ~PortLock();
  PortLock(PortLock&& other) noexcept;
  PortLock& operator=(PortLock&& other) = delete;

 private:
  explicit PortLock(int socket) : socket_(socket) {}
  int socket_;
};

}  // namespace trammel
