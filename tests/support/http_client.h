#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

namespace trammel::test {

struct HttpAnswer {
  int code = 0;  ///< 0: there was none
  std::map<std::string, std::string> headers = {};
  std::string body;
};

/// GET of `path` from 127.0.0.1.
[[nodiscard]] HttpAnswer http_get(std::uint16_t port, const std::string& path,
                                  std::chrono::milliseconds limit = std::chrono::seconds(30));
/// The reply to these bytes until the other side closes or the limit is over.
[[nodiscard]] std::string http_exchange(std::uint16_t port, const std::string& bytes,
                                        std::chrono::milliseconds limit = std::chrono::seconds(30));
[[nodiscard]] HttpAnswer parse_http(const std::string& bytes);

/// A connection that stays open during the object's life.
class OpenConnection {
 public:
  explicit OpenConnection(std::uint16_t port);
  ~OpenConnection();
  OpenConnection(const OpenConnection&) = delete;
  OpenConnection& operator=(const OpenConnection&) = delete;
  void send(const std::string& bytes) const;
  /// Until the other side closes or the limit is over.
  [[nodiscard]] std::string read(std::chrono::milliseconds limit) const;
  /// The answer, complete by its length: the connection may stay open.
  [[nodiscard]] std::string read_answer(std::chrono::milliseconds limit) const;
  /// True if the other side closes within the limit.
  [[nodiscard]] bool closes_within(std::chrono::milliseconds limit) const;

 private:
  /// Until `is_whole`, the other side closes or the limit is over.
  [[nodiscard]] std::string read_until(std::chrono::milliseconds limit,
                                       bool (*is_whole)(const std::string& bytes)) const;

  int socket_;
};

}  // namespace trammel::test
