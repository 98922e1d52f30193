#include "tests/support/http_client.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <sstream>

namespace trammel::test {

using Clock = std::chrono::steady_clock;

OpenConnection::OpenConnection(std::uint16_t port)
    : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  static_cast<void>(::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof(to)));
}

OpenConnection::~OpenConnection() { ::close(socket_); }

void OpenConnection::send(const std::string& bytes) const {
  static_cast<void>(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL));
}

std::string OpenConnection::read(std::chrono::milliseconds limit) const {
  return read_until(limit, [](const std::string&) { return false; });
}

std::string OpenConnection::read_answer(std::chrono::milliseconds limit) const {
  return read_until(limit, [](const std::string& bytes) {
    const std::size_t end = bytes.find("\r\n\r\n"), at = bytes.find("\r\nContent-Length:");
    if (end == std::string::npos || at == std::string::npos || at > end) return false;
    return bytes.size() >= end + 4 + std::stoul(bytes.substr(at + 17, 20));
  });
}

std::string OpenConnection::read_until(std::chrono::milliseconds limit,
                                       bool (*is_whole)(const std::string&)) const {
  const auto until = Clock::now() + limit;
  std::string bytes;
  std::array<char, 65536> part{};
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    pollfd look{socket_, POLLIN, 0};
    if (left <= 0 || ::poll(&look, 1, static_cast<int>(left)) <= 0) return bytes;
    const ssize_t got = ::recv(socket_, part.data(), part.size(), 0);
    if (got <= 0) return bytes;
    bytes.append(part.data(), static_cast<std::size_t>(got));
    if (is_whole(bytes)) return bytes;
  }
}

bool OpenConnection::closes_within(std::chrono::milliseconds limit) const {
  const auto until = Clock::now() + limit;
  static_cast<void>(read(limit));
  return Clock::now() < until;
}

std::string http_exchange(std::uint16_t port, const std::string& bytes,
                          std::chrono::milliseconds limit) {
  const OpenConnection connection(port);
  connection.send(bytes);
  return connection.read(limit);
}

HttpAnswer parse_http(const std::string& bytes) {
  HttpAnswer answer;
  const std::size_t end = bytes.find("\r\n\r\n");
  if (!bytes.starts_with("HTTP/1.1 ") || end == std::string::npos) return answer;
  answer.code = std::stoi(bytes.substr(9, 3));
  answer.body = bytes.substr(end + 4);
  std::istringstream lines(bytes.substr(0, end));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    const std::size_t colon = line.find(": ");
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (colon != std::string::npos) answer.headers[line.substr(0, colon)] = line.substr(colon + 2);
  }
  return answer;
}

HttpAnswer http_get(std::uint16_t port, const std::string& path, std::chrono::milliseconds limit) {
  return parse_http(http_exchange(
      port,
      fmt::format("GET {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n\r\n", path, port),
      limit));
}

}  // namespace trammel::test
