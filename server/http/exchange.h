#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace trammel {

/// A request for something to be read.
struct HttpAsk {
  std::vector<std::string> path;               ///< its words, percent signs read: `cells`, `cell-7`
  std::map<std::string, std::string> options;  ///< behind the question mark
};

struct HttpReply {
  int code = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::map<std::string, std::string> headers = {};
};

using HttpHandler = std::function<HttpReply(const HttpAsk&)>;

}  // namespace trammel
