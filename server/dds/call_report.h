#pragma once

#include <functional>
#include <string>

namespace trammel {

/// A request that has been answered, for the log. Its texts come from outside.
struct CallReport {
  std::string operation;
  std::string client;   ///< who sent it: the subject of the certificate; without one the DDS
                        ///< participant, in hex
  std::string request;  ///< the DDS writer that sent it, and its number
  std::string trace;    ///< the client's own name for it; may be empty
  std::string cell;
  bool changes = false;  ///< something, or it was to
  std::string refused;   ///< why; empty: carried out
  std::string result;    ///< the word of its result code: `ok`, `not_found`
};

using CallListener = std::function<void(const CallReport&)>;

}  // namespace trammel
