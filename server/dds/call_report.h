#pragma once

#include <functional>
#include <string>

namespace trammel {

/// A request that has been answered, for the log. Its texts come from outside.
struct CallReport {
  std::string operation;
  std::string client;   ///< the sender: the subject of its certificate; without one the DDS
                        ///< participant, in hex
  std::string request;  ///< the DDS writer that sent it, and its number
  std::string trace;    ///< the client's own name for the request; may be empty
  std::string cell;
  bool changes = false;  ///< it was a request for a change
  std::string refused;   ///< why; empty: carried out
  std::string result;    ///< the word of its result code: `ok`, `not_found`
};

using CallListener = std::function<void(const CallReport&)>;

}  // namespace trammel
