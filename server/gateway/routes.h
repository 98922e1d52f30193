#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/http/tokens.h"

namespace trammel {

/// What an address does.
enum class Endpoint {
  kPage,
  kOpenApi,
  kStatus,
  kJobs,
  kJob,
  kFindings,
  kModels,
  kPredict,
  kCorrect,
  kProgram,
  kPrograms,
  kSubmit,
  kTrain,
  kCheck,
  kDiagnose,
  kActivate,
  kRollback
};

/// An option behind the question mark.
struct RouteOption {
  const char* name;
  const char* type;  ///< of JSON Schema
  bool needed;
  const char* what;  ///< for people
};

/// One address below `/api/v1`. The table of routes is the only list of them: the gateway answers
/// by it, and the OpenAPI description is made from it.
struct Route {
  Endpoint endpoint;
  const char* method;
  const char* path;   ///< `/cells/{cell}/predict`
  Role role;          ///< the least that may ask
  const char* what;   ///< for people
  const char* takes;  ///< type of the body, and the schema's name behind a blank; empty: no body
  const char* gives;  ///< likewise of the answer
  std::vector<RouteOption> options;
};
[[nodiscard]] const std::vector<Route>& routes();

struct FoundRoute {
  const Route* route = nullptr;
  std::string cell;  ///< of the address; empty: it has none
  std::string job;
};
/// `words`: of the path, `api` and `v1` first. Empty: there is no such address. A route of another
/// method is found where none of this method is.
[[nodiscard]] std::optional<FoundRoute> find_route(const std::string& method,
                                                   const std::vector<std::string>& words);

}  // namespace trammel
