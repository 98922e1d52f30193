#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/http/tokens.h"

namespace trammel {

/// A request. One for something to be read has no body.
struct HttpAsk {
  std::vector<std::string> path;               ///< its words, percent signs read: `cells`, `cell-7`
  std::map<std::string, std::string> options;  ///< behind the question mark
  std::string method = "GET";                  ///< `GET` (also for HEAD) or `POST`
  std::map<std::string, std::string> headers = {};  ///< names in small letters
  std::string body = {};
  Asker asker = {};  ///< who has shown a token; where there are none, everybody on this host

  /// Empty: it has none of that name.
  [[nodiscard]] std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string() : found->second;
  }
  [[nodiscard]] std::string option(const std::string& name) const {
    const auto found = options.find(name);
    return found == options.end() ? std::string() : found->second;
  }
};

struct HttpReply {
  int code = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::map<std::string, std::string> headers = {};
};

using HttpHandler = std::function<HttpReply(const HttpAsk&)>;
/// Looks at a request before its body is read; a reply refuses it.
using HttpAdmission = std::function<std::optional<HttpReply>(const HttpAsk&)>;

}  // namespace trammel
